"""How fits are judged: what is left above the noise, what is worth adding, what it is called at the end."""

from __future__ import annotations

import numpy as np

from flexviz.diagnosis.fit_context import Fit
from flexviz.effects import EFFECTS, ChosenEffect

GAIN = 100.0  # fall of the objective that an effect has to bring
GAIN_LATER = 0.003  # and this share of what was gained before it: a law that is nearly right leaves traces
GAIN_EPISODE = 0.03  # the same for an episode, which can imitate much
WORTH = 0.1  # of the excess, or it is not worth a name
STRUCTURED = 1.5  # χ² per sample above the noise from which on what is left is not noise
TRACES = 1e-7  # of the first excess: what a law that is nearly right may leave besides
TRACES_UNSEEN = 1e-6  # the same of friction whose state no encoder sees
UNSEEN = ("link_coulomb_friction", "presliding_hysteresis")  # the link's reversals, the bristles' deflection
BEYOND = 20.0  # χ² per sample above the noise from which on the model, not the noise, is the measure
NAMED = 0.5  # share of what a free curve could explain that an effect has to reach where much is left
SHARPEST = 0.02  # of the record's step: time stamps are not known better
SHARPEST_DAMPED = 0.1  # the same beside a damped joint: how torques are held between samples looks like it
SMALLEST_EPISODE = 3e-5  # of the joint's rms torque: a contact that small is the trace of something else
BOTH_WAYS = 0.005  # of the samples a joint must be loaded the other way, or a gap is only an offset
LARGEST_GAIN = 0.4  # a drive whose torque is further off would have been noticed


def excess(fit: Fit) -> float:
    """Mean χ² per sample above the noise, over joints, fit and validation groups."""
    values = np.concatenate((fit.chi, fit.chi_held_out[np.isfinite(fit.chi_held_out)]))
    return float(np.mean(np.maximum(values - 1.0, 0.0)))


def removed(before: Fit, after: Fit) -> float:
    """Share of the excess that a refit removed."""
    return 1 - excess(after) / max(excess(before), 1e-9)


def score_of(before: Fit, after: Fit) -> float:
    """Share of the excess held-out variance that a refit removed; the fit groups' without any."""
    held_out = np.isfinite(before.chi_held_out).all()
    old = before.chi_held_out if held_out else before.chi
    new = after.chi_held_out if held_out else after.chi
    gone = 1 - np.maximum(new - 1, 0).sum() / max(float(np.maximum(old - 1, 0).sum()), 1e-9)
    return float(np.clip(gone, 0.0, 1.0))


def at_bound(fit: Fit, effect: ChosenEffect) -> bool:
    """Whether a parameter ended at a bound: a gain of −80 % is a search that ran away, not a finding."""
    values = fit.x[dict(fit.layout.effect_slices())[effect]]
    specs = EFFECTS[effect.effect].parameters
    edges = [
        (v, edge)
        for v, p in zip(values, specs, strict=True)
        for edge in (0.0 if p.lower_occurs else p.lower, p.upper)
        if edge
    ]
    return any(np.isfinite(edge) and abs(v - edge) <= 1e-6 * abs(edge) for v, edge in edges)


def credible(fit: Fit, effect: ChosenEffect, raw_step: float) -> bool:
    """Whether the values of an effect could be real: inside their bounds, not finer than time stamps.

    Args:
        fit: with the effect.
        effect: which one.
        raw_step: of the records [s].
    """
    if at_bound(fit, effect):
        return False
    values = fit.x[dict(fit.layout.effect_slices())[effect]]
    by_name = {p.name: abs(v) for p, v in zip(EFFECTS[effect.effect].parameters, values, strict=True)}
    if effect.effect == "torque_delay":
        damped = any(other.effect == "joint_damping" for other in fit.layout.effects)
        return by_name["delay"] > (SHARPEST_DAMPED if damped else SHARPEST) * raw_step
    torque = fit.point.narrow.torque[0][:, effect.joint or 0]
    if EFFECTS[effect.effect].scope == "episode":
        return by_name["torque"] > SMALLEST_EPISODE * float((torque**2).mean()) ** 0.5
    return effect.effect != "torque_gain" or by_name["gain_error"] < LARGEST_GAIN


def only_an_offset(fit: Fit, effect: ChosenEffect) -> bool:
    """Whether an effect is a gap in a joint that is always loaded the same way: it never crosses it."""
    if effect.effect != "backlash":
        return False
    torque = fit.point.narrow.torque[0][:, effect.joint or 0]
    return min(float((torque > 0).mean()), float((torque < 0).mean())) < BOTH_WAYS


def needed_gain(effect: ChosenEffect, gained: float) -> float:
    """Fall of the objective that an effect has to bring after `gained` was gained by others."""
    share = GAIN_EPISODE if EFFECTS[effect.effect].scope == "episode" else GAIN_LATER
    return max(GAIN, share * gained)


def structured(fit: Fit, reference: Fit) -> bool:
    """Whether what is left of what `reference`, a model without the effects, left is not noise."""
    unseen = any(e.effect in UNSEEN for e in fit.layout.effects)
    return excess(fit) > STRUCTURED + (TRACES_UNSEEN if unseen else TRACES) * excess(reference)


def verdict(fit: Fit, reference: Fit) -> str:
    """On a model to which nothing worth a name could be added; `reference` is one without any effects."""
    return "unknown" if structured(fit, reference) else "nothing-missing"
