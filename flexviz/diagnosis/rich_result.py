"""A diagnosis from a search backwards: the staircase of its effects, with the evidence of each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.confidence import probability_among_many
from flexviz.diagnosis.elimination import Necessity, by_weight
from flexviz.diagnosis.evidence import absorbed, explained_residual, made_step, own_parameters
from flexviz.diagnosis.model_family import RichModel, without_curves
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.diagnosis.result import Finding, Step, Tie
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import Projection
from flexviz.parallel import Own, alongside
from flexviz.results import Verdict

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion


@dataclass(frozen=True, eq=False)
class Stair:
    """One model of the staircase.

    Attributes:
        added: the effect that it has more than the one before; None for the first.
        layout, x: the model and its parameters, shape (P,).
        objective: of its fit.
        standard_errors: shape (P,).
        errors: its residuals.
    """

    added: ChosenEffect | None
    layout: Layout
    x: Array
    objective: float
    standard_errors: Array
    errors: PredictionErrors

    @staticmethod
    def of(
        added: ChosenEffect | None,
        fit: MotionFit,
        band: PredictionErrorBand,
        curves: Collection[ChosenEffect] = (),
    ) -> Stair:
        """The stair of a fit, without its large arrays and free curves."""
        model = without_curves(fit, curves)
        std = model.covariance(fit).standard_errors
        errors = band.errors(model, fit.context.first_phase)
        whole = fit.context.fit(model.layout, model.x, iterations=0) if curves else fit
        return Stair(added, model.layout, model.x, whole.objective, std, errors)


def staircase(
    context: MotionContext,
    own: Layout,
    rich: RichModel,
    band: PredictionErrorBand,
    own_work: Callable[[], Own],
) -> tuple[Own, list[Stair]]:
    """What `own_work` returns, and meanwhile the set's own model, then one effect more at a time.

    The weightiest effect comes first. Every model is fitted a few steps from the values that the final one,
    which is the last, predicts for it.
    """
    ordered = by_weight(rich.fit, rich.added(own))
    added = [None, *(effect for effect, _ in ordered)]

    def stair(count: int) -> Stair:
        layout = Layout(own.joints, (*own.effects, *(e for e, _ in ordered[:count])))
        start = rich.fit.towards(ordered[count][1], layout)
        fit = context.fit(layout, start, iterations=LIMITS.stair_iterations)
        return Stair.of(added[count], fit, band)

    # the largest models, which take longest, first
    done, stairs = alongside(own_work, stair, range(len(ordered))[::-1])
    return done, [*stairs[::-1], Stair.of(added[-1], rich.fit, band, rich.curves)]


def verdict_on(rich: RichModel) -> Verdict:
    """Whether the final model is complete: no unknown law, and every joint near its noise.

    What is not noise must be little of the joint's held-out torque, too.
    """
    fit = rich.fit
    ratio = fit.rms / fit.context.noise_floor
    much = (ratio > LIMITS.small_left) & (fit.held_out_rms() > LIMITS.unexplained_share * fit.context.spread)
    incomplete = rich.curves or np.any(much | (ratio > LIMITS.unexplained))
    return "unknown" if incomplete else "nothing-missing"


def leaves_only_noise(rich: RichModel) -> bool:
    """Whether the final model is complete and leaves hardly more than noise on any joint."""
    ratio = rich.fit.rms / rich.fit.context.noise_floor
    return not rich.curves and bool(np.all(ratio < LIMITS.small_left))


def just_incomplete(rich: RichModel) -> bool:
    """Whether the final model leaves little more than complete ones do, and has no free curve."""
    ratio = float(np.max(rich.fit.rms / rich.fit.context.noise_floor))
    return not rich.curves and LIMITS.unexplained < ratio < LIMITS.just_unexplained


def findings(stairs: list[Stair], rich: RichModel, band: PredictionErrorBand) -> Iterator[Finding]:
    """One finding per added effect, in the order of the staircase."""
    std = rich.fit.covariance.standard_errors
    for before, after in pairwise(stairs):
        assert after.added is not None
        effect, need = after.added, rich.needed[after.added]
        shown = features(rich, effect, need)
        yield Finding(
            effect.effect,
            rich.fit.layout.joint_name(effect),
            effect.group,
            effect.payload,
            score=removed_share(before.errors, after.errors),
            confidence=probability_among_many(shown),
            parameters=own_parameters(effect, rich.fit, std),
            inseparable_from=tuple(ties(rich, effect)),
            gain=float(before.objective - after.objective),
            absorbed=absorbed(before, after, after.standard_errors),
            evidence=explained_residual(before.layout, effect.joint, band, before.errors, after.errors),
            features=shown,
        )


def with_curves(
    stairs: list[Stair], found: list[Finding], rich: RichModel, band: PredictionErrorBand
) -> tuple[list[Stair], list[Finding]]:
    """A staircase and what it adds, continued with one more of the final model's free curves at a time."""
    curves = rich.curves
    more = [Stair.of(curve, rich.fit, band, curves[k + 1 :]) for k, curve in enumerate(curves)]
    pairs = pairwise([stairs[-1], *more])
    return [*stairs, *more], [*found, *(curve_finding(*pair, band) for pair in pairs)]


def curve_finding(before: Stair, after: Stair, band: PredictionErrorBand) -> Finding:
    """A free curve that a stair adds."""
    curve = after.added
    assert curve is not None
    return Finding(
        curve.effect,
        after.layout.joint_name(curve),
        None,
        None,
        score=removed_share(before.errors, after.errors),
        confidence=0.0,  # that it is the physics behind the residual
        parameters=own_parameters(curve, after, after.standard_errors),
        inseparable_from=(),
        gain=before.objective - after.objective,
        evidence=explained_residual(before.layout, curve.joint, band, before.errors, after.errors),
    )


def features(rich: RichModel, effect: ChosenEffect, need: Necessity) -> tuple[float, ...]:
    """What the confidence depends on.

    Returns:
        logs of the effect's size in standard errors, of its share of the joint's torque in per cent, of the
        held-out rise without it in standard errors, and of the joint's residual relative to the noise.
    """
    ratio = rich.fit.rms / rich.fit.context.noise_floor
    here = float(ratio.max() if effect.joint is None else ratio[effect.joint])
    rise = need.held_out_rise / max(need.rise_error, 1e-12)
    return (
        float(np.log(max(need.deviations, 1.0))),
        float(np.log(max(100 * need.share, 1e-2))),
        float(np.log(np.clip(rise, 0.1, 1e3))),
        float(np.log(max(here, 1.0))),
    )


def ties(rich: RichModel, effect: ChosenEffect) -> Iterator[Tie]:
    """Twins of an effect whose signature in these data is nearly its own."""
    fit = rich.fit
    law = EFFECTS[effect.effect]
    if effect.joint is None or not law.twins:
        return
    residual, jacobian = fit.whitened
    own = fit.layout.effect_slice(effect)
    others = np.delete(np.arange(fit.layout.size), own)
    flat = jacobian.reshape(-1, fit.layout.size)
    precision = (fit.information + fit.prior_derivatives[1])[np.ix_(others, others)]
    projection = Projection(residual.ravel(), flat[:, others], precision)

    def outside(column: Array) -> Array:
        left = projection.rest(column[:, None])[:, 0]
        return left / max(float(np.linalg.norm(left)), 1e-300)

    mine = outside(flat[:, own.start])
    for name in law.twins:
        other = ChosenEffect(name, effect.joint)
        if name not in EFFECTS or other in fit.layout.effects:
            continue
        best = 0.0
        for guess in EFFECTS[name].guesses(fit.point.context, other.place):
            for one in guess.columns:
                column = fit.chain.column(guess.entry, guess.joints, one) * fit.weights
                best = max(best, abs(float(outside(column.ravel()) @ mine)))
        if best > THRESHOLDS.evidence.tied_correlation:
            yield Tie(name, fit.layout.joint_name(effect), best)


def removed_share(before: PredictionErrors, after: PredictionErrors) -> float:
    """Share of the held-out excess over the noise that a step removed, each joint relative to its noise."""
    floor = np.maximum(np.array(before.noise_floor), 1e-300)

    def excess(errors: PredictionErrors) -> float:
        rms = np.array(errors.rms_validation or errors.rms)
        return float(np.maximum((rms / floor) ** 2 - 1, 0).sum())

    old, new = excess(before), excess(after)
    return float(np.clip(1 - new / max(old, 1e-300), 0.0, 1.0))


def steps(stairs: list[Stair], found: list[Finding], last: Verdict) -> list[Step]:
    """The staircase as steps of a result; `last` is the verdict on the model with all effects."""
    effects = sum(not one.stopgap for one in found)
    verdicts: list[Verdict] = [*("missing" for _ in range(effects)), *(last for _ in stairs[effects:])]
    each = zip([None, *found], stairs, verdicts, strict=True)
    return [made_step(added, stair, stair.errors, verdict) for added, stair, verdict in each]
