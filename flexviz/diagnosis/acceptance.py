"""How fits are judged: what is left above the noise, what is worth adding, what it is called at the end."""

from __future__ import annotations

import numpy as np

from flexviz.diagnosis.fit_context import Fit
from flexviz.effects import EFFECTS, ChosenEffect, EffectEvidence
from flexviz.results import Verdict

GAIN = 100.0  # fall of the objective that an effect has to bring
GAIN_LATER = 0.003  # and this share of what was gained before it: a law that is nearly right leaves traces
GAIN_EPISODE = 0.03  # the same for an episode, which can imitate much
WORTH = 0.1  # of the excess, or it is not worth a name
STRUCTURED = 1.5  # χ² per sample above the noise from which on what is left is not noise
TRACES = 1e-7  # of the first excess: what a law that is nearly right may leave besides
TRACES_UNSEEN = 1e-6  # the same of friction whose state no encoder sees
BEYOND = 20.0  # χ² per sample above the noise from which on the model, not the noise, is the measure
NAMED = 0.5  # share of what a free curve could explain that an effect has to reach where much is left


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


def credible(fit: Fit, effect: ChosenEffect, raw_step: float) -> bool:
    """Whether the values of an effect could be real.

    Args:
        fit: with the effect.
        effect: which one.
        raw_step: of the records [s].
    """
    values = fit.x[dict(fit.layout.effect_slices())[effect]]
    return EFFECTS[effect.effect].credible(values, _evidence(fit, effect, raw_step))


def only_an_offset(fit: Fit, effect: ChosenEffect, raw_step: float) -> bool:
    """Whether, in this motion, an effect only shifts its joint by a constant."""
    return EFFECTS[effect.effect].only_an_offset(_evidence(fit, effect, raw_step))


def _evidence(fit: Fit, effect: ChosenEffect, raw_step: float) -> EffectEvidence:
    torque = fit.point.narrow.torque[0][:, effect.joint or 0]
    return EffectEvidence(torque, raw_step, frozenset(e.effect for e in fit.layout.effects))


def needed_gain(effect: ChosenEffect, gained: float) -> float:
    """Fall of the objective that an effect has to bring after `gained` was gained by others."""
    share = GAIN_EPISODE if EFFECTS[effect.effect].scope == "episode" else GAIN_LATER
    return max(GAIN, share * gained)


def structured(fit: Fit, reference: Fit) -> bool:
    """Whether what is left of what `reference`, a model without the effects, left is not noise."""
    unseen = any(EFFECTS[e.effect].hidden_state for e in fit.layout.effects)
    return excess(fit) > STRUCTURED + (TRACES_UNSEEN if unseen else TRACES) * excess(reference)


def verdict(fit: Fit, reference: Fit) -> Verdict:
    """On a model to which nothing worth a name could be added; `reference` is one without any effects."""
    return "unknown" if structured(fit, reference) else "nothing-missing"
