"""Candidate effects, models with more or fewer of them, and whether values could be real."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import Fit, Fitted, Judged
from flexviz.analysis.diagnosis.unknown_curve import is_curve
from flexviz.analysis.estimation import ScoredCandidate
from flexviz.analysis.motion import Known
from flexviz.data.measurements import Group
from flexviz.model.effects import (
    EFFECT_FAMILIES,
    EFFECTS,
    ChosenEffect,
    EffectEvidence,
    everywhere,
    family_of,
)
from flexviz.model.equation import Layout

Array = NDArray[np.float64]

(OFFSET,) = (name for name, law in EFFECTS.items() if law.constant)


def is_episode(effect: ChosenEffect) -> bool:
    """Whether an effect acts for a while in one group only."""
    return EFFECTS[effect.effect].scope == "episode"


def candidates(layout: Layout, groups: Sequence[Group], many: bool = False) -> list[ChosenEffect]:
    """Every effect at every joint, payload or group of the set that lacks it, but for episodes.

    `many`: with those that only a search for many effects considers.
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
        if everywhere(place, layout.effects):
            return False
        beside = not effect.beside or any((e.effect, e.joint) == (effect.beside, place.joint) for e in have)
        warm = not effect.by_temperature or place.joint in warmed
        turns = layout.motors or effect.behind_gear
        possible = turns and layout.can_have(place)
        return (
            beside and warm and possible and place not in have and (place.effect, place.joint) not in replaced
        )

    places = (
        ChosenEffect(name, target.joint, target.group, target.payload)
        for name, effect in EFFECTS.items()
        for target in (effect.targets(layout.n, payloads) if many or not effect.only_among_many else ())
    )
    return [place for place in places if suits(place)]


def with_effects(fit: Fitted, values: Mapping[ChosenEffect, Array]) -> Known:
    """The model with effects at some values, without those that they replace."""
    replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in values}
    kept = [
        e for e in fit.layout.effects if (e.effect, e.joint) not in replaced and not everywhere(e, [*values])
    ]
    layout = fit.layout.with_effects((*kept, *(e for e in values if e not in kept)))
    x = layout.vector(fit.layout.model(fit.x))
    for effect, value in values.items():
        x[layout.effect_slice(effect)] = value
    return Known(layout, x)


def with_candidates(fit: Fitted, chosen: Sequence[ScoredCandidate]) -> Known:
    """The model with candidates at their scored values, springs where there is an offset."""
    larger = with_effects(fit, {s.effect: s.values for s in chosen})
    springs = (s.effect for s in chosen if EFFECTS[s.effect.effect].offset_parameter)
    offsets = (ChosenEffect(OFFSET, spring.joint) for spring in springs)
    return with_effects(larger, {e: np.zeros(1) for e in offsets if e not in larger.layout.effects})


def without(layout: Layout, effects: Collection[ChosenEffect]) -> Layout:
    """A layout without some effects."""
    return layout.with_effects(e for e in layout.effects if e not in effects)


def without_effects(fit: Fitted, effects: Collection[ChosenEffect]) -> Known:
    """The model without some effects."""
    smaller = without(fit.layout, effects)
    return Known(smaller, smaller.vector(fit.layout.model(fit.x)))


def rows_without_curves(layout: Layout) -> NDArray[np.intp]:
    """Parameters that are not those of free curves."""
    kept = np.ones(layout.size, bool)
    for effect, where in layout.effect_slices():
        kept[where] = not is_curve(effect)
    return np.flatnonzero(kept)


def without_curves(fit: Fitted) -> Known:
    """A fitted model without the free curves with which it was estimated."""
    layout = without(fit.layout, [*filter(is_curve, fit.layout.effects)])
    return Known(layout, fit.x[rows_without_curves(fit.layout)])


def offsets_of_springs(layout: Layout) -> frozenset[ChosenEffect]:
    """Torque offsets on a joint with a spring, whose rest angle they stand for during the search.

    k (q − q₀) with both free is singular where k is small; k (q − q̄) and an offset are linear.
    """
    springs = {e.joint for e in layout.effects if EFFECTS[e.effect].offset_parameter}
    return frozenset(e for e in layout.effects if e.effect == OFFSET and e.joint in springs)


def with_offsets_merged(fit: Fitted, own: Layout) -> Known:
    """The model in which rest angles stand for those offsets that are not the set's `own`."""
    offsets = offsets_of_springs(fit.layout) - set(own.effects)
    smaller = without(fit.layout, offsets)
    x = smaller.vector(fit.layout.model(fit.x))
    for offset in offsets:
        torque = float(fit.x[fit.layout.effect_slice(offset).start])
        for effect, where in smaller.effect_slices():
            if effect.joint == offset.joint:
                x[where] = EFFECTS[effect.effect].with_constant(x[where], torque)
    return Known(smaller, x)


def excess(fit: Fit) -> float:
    """Mean χ² per sample above the noise, over joints, fit and validation groups."""
    values = np.concatenate((fit.chi, fit.chi_held_out[np.isfinite(fit.chi_held_out)]))
    return float(np.mean(np.maximum(values - 1.0, 0.0)))


def credible(fit: Judged, effect: ChosenEffect, raw_step: float, explained: bool) -> bool:
    """Whether an effect is possible, and its form visible in the motion.

    `raw_step`: sampling interval of the records [s]; `explained`: nothing that counts is left on its joint.
    """
    layout, joint = fit.layout, effect.joint or 0
    viscous = float(layout.motor_side(fit.x)[1][joint] + fit.x[layout.link_viscous][joint])
    top_speed, travel = float(np.max(np.abs(fit.velocity[:, joint]))), float(np.ptp(fit.position[:, joint]))
    evidence = EffectEvidence(fit.torque[:, joint], raw_step, viscous, top_speed, travel, explained)
    return EFFECTS[effect.effect].credible(fit.x[layout.effect_slice(effect)], evidence)


def alternatives(effect: str) -> Iterable[str]:
    """Names of effects for which one of a joint may be exchanged."""
    law, family = EFFECTS[effect], family_of(effect)
    names = [law.replaces, law.instead_of, *(EFFECT_FAMILIES[family] if family else ())]
    names += [name for name, other in EFFECTS.items() if effect in (other.replaces, other.instead_of)]
    laws = {n: EFFECTS[n] for n in names if n and n != effect}
    return [n for n, law in laws.items() if law.scope == "joint" and law.beside is None]
