"""From a robot and a FlexibleModel to a plant: inertias, payload, gravity and every effect in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, sin

import numpy as np

from flexviz.effects.names import known_names
from flexviz.errors import InputError, choose_from
from flexviz.model import EffectValue, FlexibleModel
from flexviz.robot import PayloadBody, Robot
from flexviz.simulation.elastic import ElasticJoint
from flexviz.simulation.laws import LAWS, LINK_LAWS, MOTOR_LAWS, Dahl
from flexviz.simulation.own_effects import OWN_LAWS, own_law
from flexviz.simulation.plant import Array, Plant

G = 9.81  # [m/s²]


@dataclass(frozen=True, eq=False)
class Recorder:
    """What separates the applied from the recorded torque: applied = (1 + g)·recorded, `delay` later.

    Attributes
    ----------
    gain_error: (n,) g [-].
    delay: (n,) [s].
    """

    gain_error: Array
    delay: Array


def make_plant(
    robot: Robot,
    model: FlexibleModel,
    payload: Sequence[PayloadBody] = (),
    *,
    group: str | None = None,
    payload_name: str | None = None,
) -> tuple[Plant, Recorder]:
    """The plant of `robot` with the parameters and effects of `model`, in Pinocchio's joint order.

    An effect that names a group or a payload acts only when `group` or `payload_name` is the same.
    """
    if model.joints != robot.joints:
        raise InputError(f"the model's joints {model.joints} are not the robot's {robot.joints}")
    index = {joint: int(robot.order[i]) for i, joint in enumerate(robot.joints)}
    bodies, gravity = tuple(payload), (0.0, 0.0, -G)
    stiffness, viscous = robot.to_pin(model.stiffness), robot.to_pin(model.motor_viscous_friction)
    inertia = np.diag(robot.to_pin(model.motor_inertia))
    gain, delay = np.zeros(robot.n), np.zeros(robot.n)
    plant = Plant(None, stiffness, inertia, robot.to_pin(model.link_viscous_friction), viscous)

    for effect in model.effects:
        if effect.group not in (None, group) or effect.payload not in (None, payload_name):
            continue
        name, p = effect.effect, dict(effect.parameters)
        check_effect(effect, robot.joints)
        joints = [index[effect.joint]] if effect.joint is not None else list(range(robot.n))
        if name == "payload_error":
            bodies = tuple(scaled_body(body, 1.0 + p["relative_mass_error"]) for body in bodies)
        elif name == "base_tilt":
            gravity = tilted_gravity(p["tilt_x"], p["tilt_y"])
        for i in joints:
            if name in OWN_LAWS:
                plant.own.append((i, own_law(name, p)))
            elif name in MOTOR_LAWS:
                more = {"viscous": float(viscous[i])} if name == "friction_drift" else {}
                plant.motor_laws.append((i, MOTOR_LAWS[name](**p, **more)))
            elif name in LINK_LAWS:
                plant.link_laws.append((i, LINK_LAWS[name](**p)))
            elif name == "presliding_hysteresis":
                plant.presliding.append((i, Dahl(**p)))
            elif name == "torque_gain":
                gain[i] += p["gain_error"]
            elif name == "torque_delay":
                delay[i] += p["delay"]
            elif name == "external_contact":
                plant.contacts.append((i, p["torque"], p["start"], p["end"]))
            elif name == "motor_coupling":
                inertia[i, index[robot.joints[neighbour(robot, i)]]] += p["inertia"]
            elif LAWS[name].where == "joint":
                law = plant.elastic.get(i) or ElasticJoint(float(stiffness[i]))
                plant.elastic[i] = _with_joint_effect(law, name, p)
    plant.model = robot.model_with(model.inertial, bodies, gravity)
    return plant, Recorder(gain, delay)


def check_effect(effect: EffectValue, joints: Sequence[str]) -> None:
    """InputError when the effect, its joint or one of its parameters does not exist."""
    if effect.effect not in LAWS and effect.effect in known_names():
        raise InputError(f'effect "{effect.effect}" cannot be simulated: its class has no simulation')
    if effect.effect not in LAWS:
        raise InputError(f'effect "{effect.effect}" does not exist; {choose_from(effect.effect, LAWS, 30)}')
    if effect.joint is not None and effect.joint not in joints:
        valid = choose_from(effect.joint, joints)
        raise InputError(f'effect {effect.effect}: joint "{effect.joint}" does not exist; {valid}')
    units = LAWS[effect.effect].units
    for name in effect.parameters:
        if name not in units:
            raise InputError(f'effect {effect.effect}: no parameter "{name}"; {choose_from(name, units)}')
    for name in units:
        if name not in effect.parameters:
            raise InputError(f'effect {effect.effect}: parameter "{name}" is missing')


def neighbour(robot: Robot, i: int) -> int:
    """The joint (index in the set's order) whose motor couples into the one with Pinocchio's index i.

    It is the next joint of the set, or the one before for the last.
    """
    own = int(np.flatnonzero(robot.order == i)[0])
    if robot.n < 2:
        raise InputError("motor_coupling needs at least two joints")
    return own + 1 if own + 1 < robot.n else own - 1


def scaled_body(body: PayloadBody, factor: float) -> PayloadBody:
    """The body with mass and inertia multiplied by `factor`."""
    return PayloadBody(body.link, body.mass * factor, body.com, body.inertia * factor)


def tilted_gravity(tilt_x: float, tilt_y: float) -> tuple[float, float, float]:
    """Rᵀ (0, 0, −g) with R = Ry(tilt_y) Rx(tilt_x) [m/s²]."""
    return (G * sin(tilt_y), -G * cos(tilt_y) * sin(tilt_x), -G * cos(tilt_y) * cos(tilt_x))


def _with_joint_effect(law: ElasticJoint, name: str, p: dict[str, float]) -> ElasticJoint:
    if name == "stiffness_hardening":
        return replace(law, cubic=law.cubic + p["cubic_stiffness"])
    if name == "backlash":
        return replace(law, half_width=law.half_width + p["half_width"])
    if name == "joint_damping":
        return replace(law, damping=law.damping + p["damping"])
    return replace(law, errors=(*law.errors, (p["amplitude"], p["order"], p["phase"])))
