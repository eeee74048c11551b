"""Candidate effects, models with one effect more or fewer, and whether values could be real."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fit, Judged
from flexviz.diagnosis.prediction_errors import Known
from flexviz.effects import EFFECTS, ChosenEffect, EffectEvidence
from flexviz.equation import Layout
from flexviz.measurements import Group

Array = NDArray[np.float64]


def is_episode(effect: ChosenEffect) -> bool:
    """Whether an effect acts for a while in one group only."""
    return EFFECTS[effect.effect].scope == "episode"


def candidates(layout: Layout, groups: Sequence[Group], many: bool = False) -> list[ChosenEffect]:
    """Every effect at every joint, payload or group that lacks it; episodes are searched separately.

    Args:
        layout: the model.
        groups: all groups of the set.
        many: with those that only a search for many effects considers.
    """
    have = set(layout.effects)
    replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in layout.effects}
    payloads = sorted({g.payload for g in groups if g.bodies and not g.validation})
    # joints whose temperature every group states and that differs between two fit groups
    fitted = np.array([g.temperature for g in groups if g.temperature is not None and not g.validation])
    known = len(fitted) and all(g.temperature is not None for g in groups)
    warmed = set(np.flatnonzero(np.ptp(fitted, axis=0) > 0).tolist() if known else ())

    def suits(place: ChosenEffect) -> bool:
        effect = EFFECTS[place.effect]
        beside = not effect.beside or any((e.effect, e.joint) == (effect.beside, place.joint) for e in have)
        warm = not effect.by_temperature or place.joint in warmed
        return beside and warm and place not in have and (place.effect, place.joint) not in replaced

    places = (
        ChosenEffect(name, target.joint, target.group, target.payload)
        for name, effect in EFFECTS.items()
        for target in (effect.targets(layout.n, payloads) if many or not effect.only_among_many else ())
    )
    return [place for place in places if suits(place)]


def with_effect(layout: Layout, x: Array, effect: ChosenEffect, values: Array) -> Known:
    """The model with an effect added at `values` and without the effect that this replaces on its joint."""
    replaces = EFFECTS[effect.effect].replaces
    kept = tuple(e for e in layout.effects if not (replaces == e.effect and e.joint == effect.joint))
    larger = Layout(layout.joints, (*kept, effect))
    start = larger.vector(layout.model(x))
    start[larger.effect_slices()[-1][1]] = values
    return Known(larger, start)


def without_effect(layout: Layout, x: Array, effect: ChosenEffect) -> Known:
    """The model with one effect fewer."""
    smaller = Layout(layout.joints, tuple(e for e in layout.effects if e != effect))
    return Known(smaller, smaller.vector(layout.model(x)))


def excess(fit: Fit) -> float:
    """Mean χ² per sample above the noise, over joints, fit and validation groups."""
    values = np.concatenate((fit.chi, fit.chi_held_out[np.isfinite(fit.chi_held_out)]))
    return float(np.mean(np.maximum(values - 1.0, 0.0)))


def credible(fit: Judged, effect: ChosenEffect, raw_step: float, values: Array | None = None) -> bool:
    """Whether the parameters of an effect are plausible; `raw_step` is that of the records [s].

    `values`: other parameters of the effect than those of the fit.
    """
    layout, joint = fit.layout, effect.joint or 0
    values = fit.x[layout.effect_slice(effect)] if values is None else values
    viscous = float(fit.x[layout.motor_viscous][joint] + fit.x[layout.link_viscous][joint])
    top_speed = float(np.max(np.abs(fit.velocity[:, joint])))
    names = frozenset(e.effect for e in layout.effects)
    evidence = EffectEvidence(fit.torque[:, joint], raw_step, names, viscous, top_speed)
    return EFFECTS[effect.effect].credible(values, evidence)
