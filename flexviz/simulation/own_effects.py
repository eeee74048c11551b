"""Effects of one's own in the simulator: those whose class says how they are simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexviz.effects import EFFECTS, Effect, Instant
from flexviz.effects.own import listen
from flexviz.errors import InputError
from flexviz.model import FlexibleModel
from flexviz.simulation.laws import LAWS, LawInfo
from flexviz.simulation.own import JointState, OwnLaw, Pull

OWN_LAWS: dict[str, Effect] = {}


class EffectLaw(OwnLaw):
    """The torque that an effect's class gives, on the side where the effect acts."""

    def __init__(self, where: str, torque: Callable[[Instant], float]) -> None:
        self._where, self._torque = where, torque

    def pull(self, at: JointState) -> Pull:
        torque = float(self._torque(at))
        return Pull(
            motor=torque if self._where == "motor" else 0.0,
            link=torque if self._where == "link" else 0.0,
            joint=torque if self._where == "joint" else 0.0,
        )


def own_law(name: str, parameters: dict[str, float]) -> EffectLaw:
    """The law of an effect of one's own with these parameters."""
    effect = OWN_LAWS[name]
    torque = effect.simulation(np.array([parameters[p.name] for p in effect.parameters]))
    assert torque is not None
    return EffectLaw(effect.where, torque)


def own_sizes(name: str) -> dict[str, float]:
    """Parameters at which it is clearly there."""
    effect = OWN_LAWS[name]
    return {p.name: float(v) for p, v in zip(effect.parameters, effect.sizes(), strict=True)}


def check_sizes(text: str, name: str, parameters: dict[str, float]) -> None:
    """InputError where a parameter is out of its bounds."""
    for p in OWN_LAWS[name].parameters:
        if not p.lower <= parameters[p.name] <= p.upper:
            raise InputError(
                f'effect "{text}": {p.name} is {parameters[p.name]:g}, '
                f"{p.lower:g} to {p.upper:g} would be right"
            )


def without_unsimulated(model: FlexibleModel) -> tuple[FlexibleModel, list[str]]:
    """The model without effects of one's own that say nothing about their simulation, and a note on each."""
    kept = tuple(e for e in model.effects if e.effect in LAWS or e.effect not in EFFECTS)
    left = dict.fromkeys(e.effect for e in model.effects if e not in kept)
    return replace(model, effects=kept), [f"{name} left out: its class has no simulation" for name in left]


def _tell(effect: Effect, there: bool) -> None:
    if there and effect.simulation(effect.sizes()) is not None:
        LAWS[effect.name] = LawInfo(effect.where, {p.name: p.unit for p in effect.parameters})
        OWN_LAWS[effect.name] = effect
    elif effect.name in OWN_LAWS:
        del LAWS[effect.name], OWN_LAWS[effect.name]


listen(_tell)
