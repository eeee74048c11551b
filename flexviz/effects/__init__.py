"""The effect library: name → effect, in the order in which they are listed."""

from flexviz.effects.base import (
    Context,
    Effect,
    EffectTarget,
    Guess,
    Instant,
    JointMotion,
    LawEffect,
    LinearEffect,
    ParameterSpec,
    Terms,
    smooth_sign,
)
from flexviz.effects.friction import (
    CoulombFriction,
    FrictionDrift,
    LinkCoulombFriction,
    LoadDependentFriction,
    QuadraticFriction,
    StribeckFriction,
)
from flexviz.effects.hysteresis import PreslidingHysteresis
from flexviz.effects.load import BaseTilt, CableSpring, ExternalContact, PayloadError
from flexviz.effects.motor import MotorCoupling, TorqueOffset, TorqueRipple
from flexviz.effects.names import EFFECT_NAMES, known_names
from flexviz.effects.own import forget_effects, load_effects, loaded_files
from flexviz.effects.selection import ChosenEffect, choose_effects
from flexviz.effects.sensing import TorqueDelay, TorqueGain
from flexviz.effects.transmission import Backlash, JointDamping, StiffnessHardening, TransmissionError

EFFECTS: dict[str, Effect] = {
    e.name: e
    for e in (
        CoulombFriction(),
        StribeckFriction(),
        QuadraticFriction(),
        LoadDependentFriction(),
        PreslidingHysteresis(),
        FrictionDrift(),
        TorqueRipple(),
        TorqueOffset(),
        TorqueGain(),
        TorqueDelay(),
        StiffnessHardening(),
        Backlash(),
        JointDamping(),
        TransmissionError(),
        LinkCoulombFriction(),
        CableSpring(),
        PayloadError(),
        BaseTilt(),
        ExternalContact(),
        MotorCoupling(),
    )
}

__all__ = [
    "EFFECTS",
    "EFFECT_NAMES",
    "ChosenEffect",
    "Context",
    "Effect",
    "EffectTarget",
    "Guess",
    "Instant",
    "JointMotion",
    "LawEffect",
    "LinearEffect",
    "ParameterSpec",
    "Terms",
    "choose_effects",
    "forget_effects",
    "known_names",
    "load_effects",
    "loaded_files",
    "smooth_sign",
]
