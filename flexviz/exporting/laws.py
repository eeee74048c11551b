"""A model's effects sorted by what they are to an exporter: one number a joint, a short list, or left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECT_NAMES
from flexviz.errors import InputError
from flexviz.model import EffectValue, FlexibleModel
from flexviz.robot import GRAVITY, PayloadBody, Robot
from flexviz.simulation.building import check_effect, neighbour, scaled_body, tilted_gravity

Array = NDArray[np.float64]

# effects that are one number a joint, and sum where there are several: effect -> (parameter, field)
SUMS = {
    "coulomb_friction": ("coulomb", "motor_coulomb"),
    "quadratic_friction": ("quadratic", "quadratic"),
    "load_dependent_friction": ("coefficient", "load"),
    "torque_offset": ("offset", "offset"),
    "torque_gain": ("gain_error", "gain_error"),
    "torque_delay": ("delay", "delay"),
    "stiffness_hardening": ("cubic_stiffness", "cubic"),
    "backlash": ("half_width", "half_width"),
    "joint_damping": ("damping", "damping"),
    "link_coulomb_friction": ("coulomb", "link_coulomb"),
}
# effects of several numbers: effect -> field; the numbers are in the order of the effect's parameters
LISTS = {
    "stribeck_friction": ("stribeck", ("stribeck", "velocity")),
    "torque_ripple": ("ripple", ("amplitude", "order", "phase")),
    "transmission_error": ("error", ("amplitude", "order", "phase")),
    "friction_drift": ("drift", ("relative_rise", "time_constant")),
    "presliding_hysteresis": ("presliding", ("presliding_stiffness", "coulomb")),
}

Row = tuple[float, ...]


@dataclass(frozen=True)
class LeftOut:
    """An effect of the model that an export does not hold.

    Attributes
    ----------
    effect: name and place.
    why: the reason, a clause.
    """

    effect: str
    why: str

    @property
    def text(self) -> str:
        """`external_contact:joint1@g2: an event of one recording`"""
        return f"{self.effect}: {self.why}"


@dataclass(frozen=True, eq=False)
class Laws:
    """The model's numbers in the set's joint order, (n,) each; zero switches an effect off.

    Attributes
    ----------
    stiffness, cubic, half_width, damping: K [Nm/rad], k₃ [Nm/rad³], b [rad], D [Nm s/rad] of the joints.
    motor_inertia, motor_viscous, link_viscous: B [kg m²], f_mv and f_lv [Nm s/rad].
    motor_coulomb, link_coulomb, quadratic, load, offset: f_c [Nm], f_c at the link [Nm], f_q [Nm s²/rad²],
        μ [-], f_0 [Nm].
    gain_error, delay: g [-] and d [s]: the applied torque is 1 + g times the recorded one, d later.
    spring, spring_torque: the link's spring pulls back with spring q − spring_torque [Nm/rad], [Nm].
    stribeck: (joint, f_s [Nm], v_s [rad/s]).
    ripple, error: (joint, amplitude [Nm] or [rad], order [-], phase [rad]).
    drift: (joint, rise [-], time constant [s]).
    presliding: (joint, σ [Nm/rad], f_c [Nm]).
    coupling: (joint, neighbour, B_ij [kg m²]).
    gravity: (3,) [m/s²] in the base's frame.
    bodies: the payload's bodies as identified.
    left_out: effects that belong to none of these.
    """

    stiffness: Array
    motor_inertia: Array
    motor_viscous: Array
    link_viscous: Array
    cubic: Array
    half_width: Array
    damping: Array
    motor_coulomb: Array
    link_coulomb: Array
    quadratic: Array
    load: Array
    offset: Array
    gain_error: Array
    delay: Array
    spring: Array
    spring_torque: Array
    gravity: tuple[float, float, float] = GRAVITY
    bodies: tuple[PayloadBody, ...] = ()
    stribeck: list[Row] = field(default_factory=list)
    ripple: list[Row] = field(default_factory=list)
    error: list[Row] = field(default_factory=list)
    drift: list[Row] = field(default_factory=list)
    presliding: list[Row] = field(default_factory=list)
    coupling: list[Row] = field(default_factory=list)
    left_out: tuple[LeftOut, ...] = ()


def laws(
    robot: Robot, model: FlexibleModel, payload: str | None = None, bodies: Sequence[PayloadBody] = ()
) -> Laws:
    """The laws of `model`; `bodies` are carried, and the set calls them `payload`.

    Raises:
        InputError: for values with which there is no such robot, as a stiffness of zero.
    """
    n = robot.n
    sums: dict[str, Any] = {place: np.zeros(n) for _, place in SUMS.values()} | {
        "spring": np.zeros(n),
        "spring_torque": np.zeros(n),
    }
    lists: dict[str, Any] = {place: [] for place, _ in LISTS.values()} | {"coupling": []}
    gravity, carried, left_out = GRAVITY, tuple(bodies), []
    for effect in model.effects:
        why = _not_exported(effect, payload)
        if why:
            left_out.append(LeftOut(effect.text, why))
            continue
        check_effect(effect, robot.joints)
        name, p = effect.effect, effect.parameters
        if name == "payload_error":
            carried = tuple(scaled_body(body, 1.0 + p["relative_mass_error"]) for body in carried)
        elif name == "base_tilt":
            gravity = tilted_gravity(p["tilt_x"], p["tilt_y"])
        for i in range(n) if effect.joint is None else (robot.joints.index(effect.joint),):
            if name in SUMS:
                parameter, place = SUMS[name]
                sums[place][i] += p[parameter]
            elif name in LISTS:
                place, parameters = LISTS[name]
                lists[place].append((i, *(p[k] for k in parameters)))
            elif name == "cable_spring":
                sums["spring"][i] += p["stiffness"]
                sums["spring_torque"][i] += p["stiffness"] * p["rest_angle"]
            elif name == "motor_coupling":
                lists["coupling"].append((i, neighbour(robot, int(robot.order[i])), p["inertia"]))
    found = Laws(
        stiffness=model.stiffness,
        motor_inertia=model.motor_inertia,
        motor_viscous=model.motor_viscous_friction,
        link_viscous=model.link_viscous_friction,
        **sums,
        **lists,
        gravity=gravity,
        bodies=carried,
        left_out=tuple(left_out),
    )
    _check(found, robot.joints)
    return found


def _not_exported(effect: EffectValue, payload: str | None) -> str:
    """Why an effect is no property of the robot as it is exported; empty where it is one."""
    if effect.effect not in EFFECT_NAMES:
        return "an effect of one's own: its law is known only to the file it comes from"
    if effect.group is not None:
        return "an event of one recording, no property of the robot"
    if effect.payload not in (None, payload):
        return "concerns a payload that is not exported (--payload)"
    return ""


def _check(found: Laws, joints: Sequence[str]) -> None:
    for i, joint in enumerate(joints):
        for name, unit in (("stiffness", "Nm/rad"), ("motor_inertia", "kg m²")):
            value = float(getattr(found, name)[i])
            if not (np.isfinite(value) and value > 0.0):
                what = name.replace("_", " ")
                raise InputError(f"{what} of {joint} is {value:g} {unit}, a positive number would be right")
        for name in ("cubic", "half_width", "damping"):
            if getattr(found, name)[i] < 0.0:
                raise InputError(
                    f"{name.replace('_', ' ')} of {joint} is negative: no such joint is exported"
                )
        swing = sum(abs(a * n) for at, a, n, _ in found.error if at == i)
        if swing >= 1.0:
            raise InputError(
                f"transmission error of {joint}: amplitude times order is {swing:.3g}; below 1 would be "
                "right, else the link would turn back while the motor goes on"
            )
    for i, stiffness, coulomb in found.presliding:
        if not (stiffness > 0.0 and coulomb > 0.0):
            what = f"presliding_hysteresis of {joints[int(i)]}"
            raise InputError(f"{what}: its stiffness and friction have to be positive")
