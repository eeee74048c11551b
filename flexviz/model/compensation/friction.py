"""Friction of an identified joint while it slides, and the deflection of its spring."""

from __future__ import annotations

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, JointMotion, is_user_defined, smooth_sign
from flexviz.robot.model import FlexibleModel

BY_MOTION = ("velocity", "link velocity", "load")  # what friction depends on while it slides
SLIDING = {"presliding_hysteresis": "coulomb"}  # friction with a state → its size once it slides
ELASTIC = ("stiffness_hardening", "backlash")  # parts of the deflection with the stiffness
FINE = 4096  # points at which a spring is inverted


def by_speed_and_load(effect: str) -> bool:
    """Whether an effect of the library is friction that speed and load determine."""
    if is_user_defined(effect) or effect not in EFFECTS:
        return False
    law = EFFECTS[effect]
    return effect in SLIDING or (law.where in ("motor", "link") and law.plot_against in BY_MOTION)


def sliding_friction(model: FlexibleModel, j: int, velocity: Array, load: Array) -> Array:
    """Torque (N,) [Nm] that keeps joint j sliding at `velocity` (N,) [rad/s] under `load` (N,) [Nm].

    Viscous friction of motor and link, and every effect that is friction by speed or load; it has the sign of
    the velocity.
    """
    joint, still = model.joints[j], np.zeros(len(velocity))
    motion = JointMotion(
        np.arange(len(velocity), dtype=float), still, velocity, load, still, velocity,
        float(model.stiffness[j]), float(model.motor_viscous_friction[j]), float(np.abs(load).max()) + 1e-12,
    )  # fmt: skip
    friction = (model.link_viscous_friction[j] + model.motor_viscous_friction[j]) * velocity
    for effect in model.effects:
        if effect.joint != joint or effect.group is not None or not by_speed_and_load(effect.effect):
            continue
        if effect.effect in SLIDING:
            friction = friction + effect.parameters[SLIDING[effect.effect]] * smooth_sign(velocity)
        else:
            law = EFFECTS[effect.effect]
            values = np.array([effect.parameters[p.name] for p in law.parameters])
            friction = friction + law.law(motion, values)[0]  # type: ignore[attr-defined]  # by its variable
    return np.asarray(friction, float)


def deflection(model: FlexibleModel, j: int, torque: Array) -> Array:
    """θ − q of joint j (N,) [rad] under the joint torque (N,) [Nm]: spring, hardening and play."""
    values = {e.effect: e.parameters for e in model.effects if e.joint == model.joints[j]}
    cubic = values.get("stiffness_hardening", {}).get("cubic_stiffness", 0.0)
    play = values.get("backlash", {}).get("half_width", 0.0)
    stiffness = float(model.stiffness[j])
    most = float(np.abs(torque).max()) / stiffness
    bent = np.linspace(-most, most, FINE + 1)  # a hardening spring bends less
    found = np.interp(torque, stiffness * bent + cubic * bent**3, bent) if most > 0 else np.zeros(len(torque))
    return np.asarray(found + play * np.sign(torque), float)
