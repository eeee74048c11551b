"""The effect library: name → class, in the order in which they are listed."""

from flexviz.effects.base import Effect, JointMotion, ParameterSpec
from flexviz.effects.friction import CoulombFriction, LinkCoulombFriction
from flexviz.effects.motor import TorqueOffset
from flexviz.effects.names import EFFECT_NAMES
from flexviz.effects.selection import ChosenEffect, choose_effects

EFFECTS: dict[str, Effect] = {e.name: e for e in (CoulombFriction(), LinkCoulombFriction(), TorqueOffset())}

__all__ = [
    "EFFECTS",
    "EFFECT_NAMES",
    "ChosenEffect",
    "Effect",
    "JointMotion",
    "ParameterSpec",
    "choose_effects",
]
