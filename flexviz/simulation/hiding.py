"""Effects to hide in a simulation: `NAME[:joint][:param=value,...]`, with sensible default sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from flexviz._pinocchio import pin
from flexviz.effects.names import known_names
from flexviz.errors import InputError, choose_from
from flexviz.model import EffectValue
from flexviz.simulation.laws import LAWS
from flexviz.simulation.own_effects import OWN_LAWS, check_sizes, own_sizes
from flexviz.simulation.plan import Plan
from flexviz.simulation.plant import Array

NONE = "none"
_NAMES = ("group", "payload")  # keys whose value is a name


@dataclass(frozen=True, eq=False)
class Scale:
    """How much each joint works in a plan: rms torque [Nm], speed [rad/s], deflection [rad], each (n,)."""

    torque: Array
    speed: Array
    deflection: Array


def hide(plan: Plan, wanted: Sequence[str]) -> Plan:
    """The plan with the effects that `wanted` names ("none" hides nothing)."""
    effects = [effect for text in wanted if text.strip() != NONE for effect in parse(text, plan)]
    where = [(e.effect, e.joint, e.group, e.payload) for e in effects]
    for one in where:
        if where.count(one) > 1:
            place = " ".join(str(x) for x in one[1:] if x)
            raise InputError(f'effect "{one[0]}" is given twice{f" on {place}" if place else ""}')
    return replace(plan, model=replace(plan.model, effects=(*plan.model.effects, *effects)))


def parse(text: str, plan: Plan) -> list[EffectValue]:
    """The effects that one option stands for; without a joint, one on every joint."""
    name, *rest = (part.strip() for part in text.split(":"))
    if name not in LAWS and name in known_names():
        raise InputError(f'effect "{name}" cannot be hidden: its class has no simulation')
    if name not in LAWS:
        raise InputError(f'effect "{name}" does not exist; {choose_from(name, LAWS, 30)}')
    info = LAWS[name]
    place: str | None = rest.pop(0) if rest and "=" not in rest[0] else None
    given = _values(text, rest)
    names = {key: str(given.pop(key)) for key in _NAMES if key in given}
    for key in given:
        if key not in info.units:
            raise InputError(f'effect "{text}": no parameter "{key}"; {choose_from(key, info.units)}')
    joints: Sequence[str | None] = plan.robot.joints
    payload: str | None = names.get("payload")
    if info.belongs_to == "payload":
        payload = place or payload or heaviest(plan)
        joints = (None,)
    elif place is not None:
        if info.belongs_to == "set" and name != "torque_delay":
            raise InputError(f'effect "{text}": {name} belongs to no joint')
        if place not in plan.robot.joints:
            valid = choose_from(place, plan.robot.joints)
            raise InputError(f'effect "{text}": joint "{place}" does not exist; {valid}')
        joints = (place,)
    elif info.belongs_to == "set":
        joints = (None,)
    elif name == "external_contact":
        joints = (plan.robot.joints[min(1, plan.robot.n - 1)],)
    group: str | None = names.get("group")
    if name == "external_contact" and group is None:
        group = plan.groups[0].name
    _check(text, "group", group, [g.name for g in plan.groups])
    _check(text, "payload", payload, list(plan.payloads))
    size = scale(plan)
    result = []
    for joint in joints:
        values = default_parameters(name, joint, plan, size) | {k: float(v) for k, v in given.items()}
        _check_values(text, name, values)
        if name in OWN_LAWS:
            check_sizes(text, name, values)
        result.append(EffectValue(name, joint, values, group=group, payload=payload))
    return result


def default_parameters(name: str, joint: str | None, plan: Plan, size: Scale) -> dict[str, float]:
    """Parameters that make the effect clearly visible on that joint without dominating it."""
    if name in OWN_LAWS:
        return own_sizes(name)
    i = plan.robot.joints.index(joint) if joint is not None else 0
    torque, speed, bend = float(size.torque[i]), float(size.speed[i]), float(size.deflection[i])
    stiffness, inertia = float(plan.model.stiffness[i]), plan.model.motor_inertia
    j = i + 1 if i + 1 < plan.robot.n else i - 1
    duration = plan.groups[0].duration
    start = float(plan.groups[0].reference.sample(np.zeros(1))[0][0, i])
    raw = {
        "coulomb_friction": {"coulomb": 0.2 * torque},
        "stribeck_friction": {"stribeck": 0.2 * torque, "velocity": 0.2 * speed},
        "quadratic_friction": {"quadratic": 0.15 * torque / speed**2},
        "load_dependent_friction": {"coefficient": 0.1},
        "presliding_hysteresis": {"presliding_stiffness": 50.0 * torque, "coulomb": 0.2 * torque},
        "friction_drift": {"relative_rise": 0.6, "time_constant": 0.4 * duration},
        "torque_ripple": {"amplitude": 0.1 * torque, "order": 9.0, "phase": 0.7},
        "torque_offset": {"offset": 0.15 * torque},
        "torque_gain": {"gain_error": 0.05},
        "torque_delay": {"delay": 0.002},
        "stiffness_hardening": {"cubic_stiffness": 0.2 * stiffness / bend**2},
        "backlash": {"half_width": max(0.15 * bend, 2e-4)},
        "joint_damping": {"damping": 0.008 * stiffness},
        "transmission_error": {"amplitude": max(0.05 * bend, 3e-4), "order": 7.0, "phase": 0.4},
        "link_coulomb_friction": {"coulomb": 0.2 * torque},
        "cable_spring": {"stiffness": 0.3 * torque, "rest_angle": start + 0.2},
        "payload_error": {"relative_mass_error": 0.1},
        "base_tilt": {"tilt_x": 0.02, "tilt_y": 0.03},
        "external_contact": {"torque": 0.5 * torque, "start": 0.4 * duration, "end": 0.55 * duration},
        "motor_coupling": {"inertia": 0.2 * float(np.sqrt(inertia[i] * inertia[j]))},
    }[name]
    return {key: float(f"{value:.3g}") for key, value in raw.items()}


def scale(plan: Plan) -> Scale:
    """Rms torque, speed and deflection of every joint over the plan's groups, as if the joints were rigid."""
    robot = plan.robot
    torque2, speed2, count = np.zeros(robot.n), np.zeros(robot.n), 0
    for group in plan.groups:
        model = robot.model_with(plan.model.inertial, plan.payloads[group.payload])
        data = model.createData()
        step = group.duration / 200
        time = np.arange(1, 200) * step
        position, velocity = (robot.to_pin(x) for x in group.reference.sample(time))
        acceleration = np.gradient(velocity, step, axis=0)
        rows = zip(position, velocity, acceleration, strict=True)
        torque = robot.from_pin(np.array([pin.rnea(model, data, *row).copy() for row in rows]))
        torque2 += (torque**2).sum(axis=0)
        speed2 += (robot.from_pin(velocity) ** 2).sum(axis=0)
        count += len(time)
    speed = np.sqrt(speed2 / count) + 1e-3
    viscous = (plan.model.link_viscous_friction + plan.model.motor_viscous_friction) * speed
    torque = np.sqrt(torque2 / count) + viscous + 1e-6
    return Scale(torque, speed, torque / plan.model.stiffness)


def heaviest(plan: Plan) -> str:
    """The payload with the most mass."""
    weight = {name: sum(body.mass for body in bodies) for name, bodies in plan.payloads.items()}
    name = max(weight, key=weight.__getitem__)
    if not weight[name]:
        raise InputError("payload_error needs a payload with a mass, this set has none")
    return name


def _values(text: str, parts: list[str]) -> dict[str, str | float]:
    """The `param=value` pairs of an option; values are numbers except those of `group` and `payload`."""
    values: dict[str, str | float] = {}
    for pair in ",".join(parts).split(","):
        if not pair.strip():
            continue
        key, sign, value = (piece.strip() for piece in pair.partition("="))
        if not sign or not key:
            raise InputError(f'effect "{text}": "{pair}" is not of the form param=value')
        if key in _NAMES:
            values[key] = value
            continue
        try:
            values[key] = float(value)
        except ValueError:
            raise InputError(f'effect "{text}": {key}={value} is not a number') from None
    return values


def _check(text: str, what: str, name: str | None, valid: list[str]) -> None:
    if name is not None and name not in valid:
        raise InputError(f'effect "{text}": {what} "{name}" does not exist; {choose_from(name, valid)}')


_POSITIVE = {
    "stribeck_friction": ("velocity",),
    "presliding_hysteresis": ("presliding_stiffness", "coulomb"),
    "friction_drift": ("time_constant",),
}
_NOT_NEGATIVE = {"torque_delay": ("delay",), "backlash": ("half_width",)}


def _check_values(text: str, name: str, values: dict[str, float]) -> None:
    for key, value in values.items():
        if not isfinite(value):
            raise InputError(f'effect "{text}": {key} is {value}, a finite number would be right')
        if key in _POSITIVE.get(name, ()) and value <= 0:
            raise InputError(f'effect "{text}": {key} is {value:g}, a positive number would be right')
        if key in _NOT_NEGATIVE.get(name, ()) and value < 0:
            raise InputError(f'effect "{text}": {key} is {value:g}, a number ≥ 0 would be right')
