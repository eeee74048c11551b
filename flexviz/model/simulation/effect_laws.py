"""The simulator's implementation of each library effect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import cos, sin
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.model.simulation import laws
from flexviz.model.simulation.laws import ElasticJoint
from flexviz.model.simulation.plant import Array, Plant
from flexviz.robot.mounting import GRAVITY, upright
from flexviz.robot.robot import PayloadBody, Robot


@dataclass(frozen=True, eq=False)
class TorquePath:
    """From the recorded to the applied torque: applied = (1 + g)·recorded, `delay` later."""

    gain_error: Array  # (n,), g [-]
    delay: Array  # (n,) [s]
    limit: Array  # (n,), beyond which a command does not act, or is not recorded [Nm]


@dataclass
class Assembly:
    """A plant under construction, to which effects are added; Pinocchio's joint order."""

    robot: Robot
    plant: Plant  # still without a model
    bodies: tuple[PayloadBody, ...]  # the payload
    gravity: tuple[float, float, float]  # (3,), in the base frame [m/s²]
    path: TorquePath  # from the recorded to the applied torque
    temperature: Array  # (n,), of the joints during the run [°C]


def neighbour(robot: Robot, i: int) -> int:
    """The joint (index in the set's order) that is coupled with the joint of Pinocchio's index i.

    It is the next joint of the set; for the last joint, the preceding one.
    """
    own = int(np.flatnonzero(robot.order == i)[0])
    if robot.n < 2:
        raise InputError("an effect that couples two joints needs a robot with at least two")
    return own + 1 if own + 1 < robot.n else own - 1


def scaled_body(body: PayloadBody, factor: float) -> PayloadBody:
    """The body with mass and inertia multiplied by `factor`."""
    return PayloadBody(body.link, body.mass * factor, body.com, body.inertia * factor)


def tilted_gravity(
    tilt_x: float, tilt_y: float, gravity: Sequence[float] = GRAVITY
) -> tuple[float, float, float]:
    """Rᵀ (0, 0, −g) with R = Ry(tilt_y) Rx(tilt_x) [m/s²], where the base stands upright.

    Else tilted about the level axes of the frame in which the stated `gravity` (3,) points down.
    """
    g = float(np.linalg.norm(gravity))
    tilted = (g * sin(tilt_y), -g * cos(tilt_y) * sin(tilt_x), -g * cos(tilt_y) * cos(tilt_x))
    x, y, z = map(float, upright(gravity).T @ tilted)
    return x, y, z


Parameters = Mapping[str, float]
Enter = Callable[[Assembly, Sequence[int], Parameters], None]


@dataclass(frozen=True)
class EffectLaw:
    """Implementation of an effect."""

    enter: Enter  # adds the law to a plant, on the given joints
    # positive, not_negative: parameters that must be > 0, or ≥ 0
    positive: tuple[str, ...] = ()
    not_negative: tuple[str, ...] = ()


def on_each(
    part: str,
    law: Callable[..., Any],
    positive: tuple[str, ...] = (),
    not_negative: tuple[str, ...] = (),
    **of_joint: Callable[[Assembly, int], float],
) -> EffectLaw:
    """A law in a list of the plant on each joint; `of_joint`: further arguments that depend on the joint."""

    def enter(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
        for i in joints:
            more = {name: value(made, i) for name, value in of_joint.items()}
            getattr(made.plant, part).append((i, law(**p, **more)))

    return EffectLaw(enter, positive, not_negative)


motor, link = partial(on_each, "motor_laws"), partial(on_each, "link_laws")


def elastic(
    change: Callable[[ElasticJoint, Parameters], ElasticJoint], not_negative: tuple[str, ...] = ()
) -> EffectLaw:
    """A change of the elastic law of each joint."""

    def enter(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
        for i in joints:
            made.plant.elastic[i] = change(made.plant.joint(i), p)

    return EffectLaw(enter, not_negative=not_negative)


def _torque_gain(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    made.path.gain_error[list(joints)] += p["gain_error"]


def _torque_delay(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    made.path.delay[list(joints)] += p["delay"]


def _torque_limit(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    if p["limit"] > 0.0:
        made.path.limit[list(joints)] = p["limit"]


def _payload_error(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    made.bodies = tuple(scaled_body(body, 1.0 + p["relative_mass_error"]) for body in made.bodies)


def _base_tilt(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    made.gravity = tilted_gravity(p["tilt_x"], p["tilt_y"], made.robot.gravity)


def _external_contact(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    made.plant.contacts += [(i, p["torque"], p["start"], p["end"]) for i in joints]


def _motor_coupling(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    for i in joints:
        made.plant.motor_inertia[i, int(made.robot.order[neighbour(made.robot, i)])] += p["inertia"]


def _coupled_friction(made: Assembly, joints: Sequence[int], p: Parameters) -> None:
    for i in joints:
        other = int(made.robot.order[neighbour(made.robot, i)])
        made.plant.coupled_laws.append((i, other, laws.coupled_friction(**p)))


LAWS: dict[str, EffectLaw] = {
    "coulomb_friction": motor(laws.coulomb_friction),
    "stribeck_friction": motor(laws.stribeck_friction, positive=("velocity",)),
    "quadratic_friction": motor(laws.quadratic_friction),
    "directional_friction": motor(laws.directional_friction),
    "thinning_friction": motor(laws.thinning_friction, positive=("velocity",)),
    "load_dependent_friction": motor(laws.load_dependent_friction),
    "driving_friction": motor(laws.driving_friction, not_negative=("motor_driving", "load_driving")),
    "presliding_hysteresis": on_each("extra", laws.Dahl, ("presliding_stiffness", "coulomb")),
    "startup_friction": on_each("extra", laws.BreakAway, ("angle",)),
    "friction_drift": motor(
        laws.friction_drift, ("time_constant",), viscous=lambda made, i: float(made.plant.motor_viscous[i])
    ),
    "temperature_friction": motor(
        laws.temperature_friction,
        not_negative=("viscous_fall",),
        temperature=lambda made, i: float(made.temperature[i]),
    ),
    "torque_ripple": motor(laws.torque_ripple),
    "torque_offset": motor(laws.torque_offset),
    "torque_gain": EffectLaw(_torque_gain),
    "torque_delay": EffectLaw(_torque_delay, not_negative=("delay",)),
    "torque_limit": EffectLaw(_torque_limit, not_negative=("limit",)),
    "stiffness_hardening": elastic(lambda law, p: replace(law, cubic=law.cubic + p["cubic_stiffness"])),
    "backlash": elastic(
        lambda law, p: replace(law, half_width=law.half_width + p["half_width"]), ("half_width",)
    ),
    "joint_damping": elastic(lambda law, p: replace(law, damping=law.damping + p["damping"])),
    "transmission_error": elastic(
        lambda law, p: replace(law, errors=(*law.errors, (p["amplitude"], p["order"], p["phase"])))
    ),
    "link_coulomb_friction": link(laws.link_coulomb_friction),
    "cable_spring": link(laws.cable_spring),
    "gravity_compensator": link(laws.gravity_compensator),
    "payload_error": EffectLaw(_payload_error),
    "base_tilt": EffectLaw(_base_tilt),
    "external_contact": EffectLaw(_external_contact),
    "motor_coupling": EffectLaw(_motor_coupling),
    "coupled_friction": EffectLaw(_coupled_friction),
}
"""Library effect → its implementation in the simulator."""
