"""Acceptance criteria: excess over the noise, minimum gain of an effect, verdict on the final model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import is_episode
from flexviz.diagnosis.fit_context import Fit, FitContext, Judged
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect, EffectEvidence
from flexviz.equation import viscous_scale
from flexviz.results import Verdict
from flexviz.statistics import NORMAL_95

LIMITS = THRESHOLDS.acceptance


def excess(fit: Fit) -> float:
    """Mean χ² per sample above the noise, over joints, fit and validation groups."""
    values = np.concatenate((fit.chi, fit.chi_held_out[np.isfinite(fit.chi_held_out)]))
    return float(np.mean(np.maximum(values - 1.0, 0.0)))


def largest_excess(fit: Fit) -> float:
    """The same of the joint with the largest one: on an arm, the mean hides what one joint leaves."""
    above = np.maximum(np.stack((fit.chi, fit.chi_held_out)) - 1.0, 0.0)
    return float(np.nanmean(above, axis=0).max())


def quiet(fit: Fit) -> bool:
    """Whether every joint is near its noise, in the fit and the validation groups."""
    return bool(np.all(np.fmax(fit.chi, fit.chi_held_out) < THRESHOLDS.motion.quiet_model**2))


def removed_share(before: Fit, after: Fit) -> float:
    """Share of the excess that a refit removed."""
    return 1 - excess(after) / max(excess(before), 1e-9)


def held_out_share(before: Fit, after: Fit) -> float:
    """Share of the excess held-out variance that a refit removed; of the fit groups if none are held out."""
    held_out = np.isfinite(before.chi_held_out).all()
    old = before.chi_held_out if held_out else before.chi
    new = after.chi_held_out if held_out else after.chi
    share = 1 - np.maximum(new - 1, 0).sum() / max(float(np.maximum(old - 1, 0).sum()), 1e-9)
    return float(np.clip(share, 0.0, 1.0))


def credible(
    fit: Judged, effect: ChosenEffect, raw_step: float, values: NDArray[np.float64] | None = None
) -> bool:
    """Whether the parameters of an effect are plausible; `raw_step` is that of the records [s].

    `values`: other parameters than those of the fit, shape (P,).
    """
    values = fit.x[fit.layout.effect_slice(effect)] if values is None else values
    return EFFECTS[effect.effect].credible(values, effect_evidence(fit, effect, raw_step))


def held_to_be_zero(context: FitContext, fit: Fit, effect: ChosenEffect) -> bool:
    """Whether the 95 % intervals of all that makes up an effect's size include zero."""
    return not size_in_errors(context, fit, effect) >= NORMAL_95  # also where no interval can be given


def size_in_errors(context: FitContext, fit: Fit, effect: ChosenEffect) -> float:
    """The largest of what makes up an effect's size, in its standard errors; nan where there are none.

    A size relative to the motor's viscous friction counts as a torque: of a stiff joint the data show the sum
    of both sides' friction, so that the share alone is uncertain where the torque is not.
    """
    law, x, layout = EFFECTS[effect.effect], fit.x, fit.layout
    first = layout.effect_slice(effect).start
    rows = [first + k for k in law.size_at]
    size, slopes = x[rows], np.eye(len(x))[rows]
    if law.relative and effect.joint is not None:
        scale, by_motor, by_link = viscous_scale(layout, x, effect.joint)
        slopes *= scale
        slopes[:, layout.motor_viscous.start + effect.joint] += by_motor * size
        slopes[:, layout.link_viscous.start + effect.joint] += by_link * size
        size = scale * size
    variance = np.einsum("kp,pq,kq->k", slopes, context.covariance(fit).matrix, slopes)
    std = np.sqrt(np.maximum(variance, 0.0))
    return float(np.fmax.reduce(np.divide(np.abs(size), std, out=np.full(len(size), np.inf), where=std != 0)))


def only_an_offset(fit: Judged, effect: ChosenEffect, raw_step: float) -> bool:
    """Whether an effect amounts to a constant offset of its joint in this motion."""
    return EFFECTS[effect.effect].only_an_offset(effect_evidence(fit, effect, raw_step))


def effect_evidence(fit: Judged, effect: ChosenEffect, raw_step: float) -> EffectEvidence:
    """The data by which an effect of a fit is judged; `raw_step` is that of the records [s]."""
    joint, layout = effect.joint or 0, fit.layout
    viscous = float(fit.x[layout.motor_viscous][joint] + fit.x[layout.link_viscous][joint])
    top_speed = float(np.max(np.abs(fit.velocity[:, joint])))
    names = frozenset(e.effect for e in layout.effects)
    return EffectEvidence(fit.torque[:, joint], raw_step, names, viscous, top_speed)


@dataclass(frozen=True, eq=False)
class Gained:
    """Gain of a model's effects over the same parameters without them.

    Attributes:
        total: decrease of the objective.
        by_joint: shape (n,), the part of each joint's residual: that is where approximate models of
            effects leave traces.
    """

    total: float
    by_joint: NDArray[np.float64]

    @classmethod
    def by_effects(cls, fit: Fit, reference: Fit) -> Gained:
        """Of a fit; `reference`: its parameters without effects."""
        joints = _by_joint(reference) - _by_joint(fit)
        return cls(reference.objective - fit.objective, np.maximum(joints, 0.0))

    def at(self, effect: ChosenEffect) -> float:
        """The part where an effect acts; the largest one for an effect on all joints."""
        return float(self.by_joint.max() if effect.joint is None else self.by_joint[effect.joint])


def _by_joint(fit: Fit) -> NDArray[np.float64]:
    """Noise objective of each joint over all groups, shape (n,)."""
    fitted, held_out = fit.point.objective_by_joint, fit.held_out
    return fitted if held_out is None else fitted + held_out.objective_by_joint


def needed_gain(effect: ChosenEffect, gained: Gained) -> float:
    """Minimum gain for accepting an effect after earlier effects gained `gained`."""
    if is_episode(effect):
        return _needed(gained.total, LIMITS.least_gain_share_episode)
    return _needed(gained.at(effect), LIMITS.least_gain_share)


def _needed(gained: float, share: float) -> float:
    return max(LIMITS.least_gain, share * gained)


def exhausted(fit: Fit, gained: Gained) -> bool:
    """Whether no further effect can gain enough, since all that is above the noise is less than that."""
    points = (fit.point, fit.held_out)
    above = sum(point.objective for point in points if point is not None)
    return above < _needed(float(gained.by_joint.min()), LIMITS.least_gain_share)


def structured(fit: Fit, reference: Fit) -> bool:
    """Whether a residual exceeds the noise plus a small share of the residual without any effects.

    Models of effects are approximate, so that each leaves a trace of what it explains; more at reversals,
    where torques are only roughly known.
    """
    explained = excess(reference)
    hidden = any(EFFECTS[e.effect].hidden_state for e in fit.layout.effects)
    share = LIMITS.trace_share_hidden_state if hidden else LIMITS.trace_share
    trace = share * explained
    mean, joint = LIMITS.structured_excess, LIMITS.structured_joint
    if not fit.layout.has_reversals:
        mean, joint = LIMITS.structured_excess_smooth, LIMITS.structured_joint_smooth
        trace += min(LIMITS.trace_share_smooth * explained, LIMITS.structured_excess - mean)
    return excess(fit) > mean + trace or largest_excess(fit) > joint + trace


def verdict(fit: Fit, reference: Fit) -> Verdict:
    """Verdict on a model without further acceptable candidates; `reference` has no effects at all."""
    return "unknown" if structured(fit, reference) else "nothing-missing"
