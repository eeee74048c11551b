"""A robot whose joints follow goals as a model, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.servo.parameters import INDEX, NAMES, SERVO_EFFECTS, absent, of_effect
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import Robot

GAIN = "position_control"  # effect that every such joint has


def servo_model(robot: Robot, values: Array, effects: Sequence[ChosenEffect]) -> FlexibleModel:
    """The model with parameters `values` (P, n); joints with the same servo have each effect of it."""
    n = robot.n
    gains = [
        EffectValue(GAIN, joint, {"gain": float(values[INDEX["gain"], j])})
        for j, joint in enumerate(robot.joints)
    ]
    own = []
    for key in effects:
        j = key.joint or 0
        found = {NAMES[p].partition(".")[2]: in_newtons(values, p, j) for p in of_effect(key.effect)}
        found |= {name: 0.0 for name in EFFECTS[key.effect].units if name not in found}  # a rest angle
        own.append(EffectValue(key.effect, robot.joints[j], found))
    return FlexibleModel(
        robot.joints, np.full(n, np.inf), values[INDEX["motor_inertia"]], np.zeros(n),
        values[INDEX["motor_viscous_friction"]], robot.cad_parameters, (*gains, *own),
    )  # fmt: skip


def in_newtons(values: Array, p: int, j: int) -> float:
    """A parameter in the unit of its effect; an offset is fitted as the angle by which the goal differs."""
    scale = values[INDEX["gain"], j] if NAMES[p] == "torque_offset.offset" else 1.0
    return float(scale * values[p, j])


def follows_goals(model: FlexibleModel) -> bool:
    """Whether the joints of a model follow goals."""
    return any(effect.effect == GAIN for effect in model.effects)


def servo_values(model: FlexibleModel) -> Array:
    """(P, n) parameters of a model whose joints follow goals."""
    values = absent(model.n)
    values[INDEX["motor_inertia"]] = model.motor_inertia
    values[INDEX["motor_viscous_friction"]] = model.motor_viscous_friction
    gains = {effect.joint: effect.parameters["gain"] for effect in model.effects if effect.effect == GAIN}
    for j, joint in enumerate(model.joints):
        values[INDEX["gain"], j] = gains[joint]
    for effect in model.effects:
        if effect.effect not in SERVO_EFFECTS:
            continue
        joints = [j for j, joint in enumerate(model.joints) if effect.joint in (None, joint)]
        for p in of_effect(effect.effect):
            for j in joints:
                size = effect.parameters[NAMES[p].partition(".")[2]]
                as_angle = NAMES[p] == "torque_offset.offset"
                values[p, j] = size / values[INDEX["gain"], j] if as_angle else size
    return values
