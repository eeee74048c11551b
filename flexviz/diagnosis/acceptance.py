"""Excess of a fit over the noise, and whether the parameters of an effect could be real."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fit, Judged
from flexviz.effects import EFFECTS, ChosenEffect, EffectEvidence


def excess(fit: Fit) -> float:
    """Mean χ² per sample above the noise, over joints, fit and validation groups."""
    values = np.concatenate((fit.chi, fit.chi_held_out[np.isfinite(fit.chi_held_out)]))
    return float(np.mean(np.maximum(values - 1.0, 0.0)))


def credible(
    fit: Judged, effect: ChosenEffect, raw_step: float, values: NDArray[np.float64] | None = None
) -> bool:
    """Whether the parameters of an effect are plausible; `raw_step` is that of the records [s].

    `values`: other parameters than those of the fit, shape (P,).
    """
    values = fit.x[fit.layout.effect_slice(effect)] if values is None else values
    return EFFECTS[effect.effect].credible(values, effect_evidence(fit, effect, raw_step))


def effect_evidence(fit: Judged, effect: ChosenEffect, raw_step: float) -> EffectEvidence:
    """The data by which an effect of a fit is judged; `raw_step` is that of the records [s]."""
    joint, layout = effect.joint or 0, fit.layout
    viscous = float(fit.x[layout.motor_viscous][joint] + fit.x[layout.link_viscous][joint])
    top_speed = float(np.max(np.abs(fit.velocity[:, joint])))
    names = frozenset(e.effect for e in layout.effects)
    return EffectEvidence(fit.torque[:, joint], raw_step, names, viscous, top_speed)
