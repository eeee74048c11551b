"""Effects to inject into a simulation: `NAME[:joint][:param=value,...]`, with sensible default sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from math import isfinite

import numpy as np

from flexviz.base.errors import InputError, choose_from
from flexviz.data.measurements import SetHeader
from flexviz.model.effects import EFFECTS, Effect, JointScale, is_user_defined
from flexviz.model.simulation.building import require_simulated
from flexviz.model.simulation.effect_laws import LAWS
from flexviz.model.simulation.plan import Plan, PlannedGroup
from flexviz.model.simulation.plant import Array
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import EffectValue

NONE = "none"
TEMPERATURES = (25.0, 45.0, 35.0, 40.0)  # [°C] in turn, of groups that state none, where an effect needs them
_NAMES = ("group", "payload")  # keys whose value is a name


@dataclass(frozen=True, eq=False)
class MotionScale:
    """Rms torque [Nm], speed [rad/s] and deflection [rad] of each joint in a plan, (n,) each."""

    torque: Array
    speed: Array
    deflection: Array


def inject(plan: Plan, wanted: Sequence[str]) -> Plan:
    """The plan with the effects that `wanted` names ("none" injects nothing)."""
    effects = [effect for text in wanted if text.strip() != NONE for effect in parse(text, plan)]
    where = [(e.effect, e.joint, e.group, e.payload) for e in effects]
    for one in where:
        if where.count(one) > 1:
            place = " ".join(str(x) for x in one[1:] if x)
            raise InputError(f'effect "{one[0]}" is given twice{f" on {place}" if place else ""}')
    if any(EFFECTS[e.effect].by_temperature for e in effects):
        plan = replace(plan, groups=warmed(plan, TEMPERATURES, keep=True))
    return replace(plan, model=replace(plan.model, effects=(*plan.model.effects, *effects)))


def at_temperatures(plan: Plan, degrees: Sequence[float]) -> Plan:
    """The plan with temperatures [°C], one per group or one for all; the same for all joints of a group."""
    if len(degrees) not in (1, len(plan.groups)):
        expected = f"one per group ({len(plan.groups)}) or one for all"
        raise InputError(f"{len(degrees)} temperatures, expected {expected}")
    SetHeader.check_temperature(list(degrees), len(degrees), None, "groups")
    return replace(plan, groups=warmed(plan, degrees))


def warmed(plan: Plan, degrees: Sequence[float], keep: bool = False) -> tuple[PlannedGroup, ...]:
    """The groups with temperatures [°C] in turn; `keep` those that they have."""
    n, pairs = plan.robot.n, zip(plan.groups, cycle(degrees), strict=False)
    return tuple(replace(g, temperature=(keep and g.temperature) or (float(t),) * n) for g, t in pairs)


def parse(text: str, plan: Plan) -> list[EffectValue]:
    """The effects of one option; one on every joint if it names none."""
    name, *rest = (part.strip() for part in text.split(":"))
    require_simulated(name, "hidden")
    effect = EFFECTS[name]
    place: str | None = rest.pop(0) if rest and "=" not in rest[0] else None
    given = _values(text, rest)
    names = {key: str(given.pop(key)) for key in _NAMES if key in given}
    for key in given:
        if key not in effect.units:
            raise InputError(f'effect "{text}": no parameter "{key}"; {choose_from(key, effect.units)}')
    payload: str | None = names.get("payload")
    group: str | None = names.get("group")
    if effect.scope == "payload":
        payload = place or payload or heaviest(plan)
    elif effect.scope == "episode" and group is None:
        group = plan.groups[0].name
    joints = _joints(text, effect, place, plan)
    _check(text, "group", group, [g.name for g in plan.groups])
    _check(text, "payload", payload, list(plan.payloads))
    if effect.scope == "payload" and payload is not None and not mass(plan, payload):
        raise InputError(f'effect "{text}": payload "{payload}" has no mass, expected one that has')
    size = motion_scale(plan)
    result = []
    for joint in joints:
        values = default_parameters(name, joint, plan, size) | {k: float(v) for k, v in given.items()}
        _check_values(text, effect, values)
        if effect.scope == "episode":
            duration = next(each.duration for each in plan.groups if each.name == group)
            _check_episode(text, effect, values, duration)
        result.append(EffectValue(name, joint, values, group=group, payload=payload))
    return result


def _joints(text: str, effect: Effect, place: str | None, plan: Plan) -> Sequence[str | None]:
    """The joints that an effect is injected on; (None,) for one that belongs to no joint."""
    if effect.scope == "payload":
        return (None,)
    if place is None:
        if effect.scope == "episode":
            return (plan.robot.joints[min(1, plan.robot.n - 1)],)
        if effect.scope == "set":
            return (None,)
        if plan.robot.n < effect.fewest_joints:
            raise InputError(f'effect "{text}" needs a neighbouring joint, the robot has one joint')
        return [plan.robot.joints[t.own_joint] for t in effect.targets(plan.robot.n, ())]
    if effect.scope == "set" and not effect.joint_optional:
        raise InputError(f'effect "{text}": {effect.name} belongs to no joint')
    _check(text, "joint", place, list(plan.robot.joints))
    return (place,)


def default_parameters(name: str, joint: str | None, plan: Plan, size: MotionScale) -> dict[str, float]:
    """Parameters that make the effect clearly visible on that joint without dominating it."""
    effect = EFFECTS[name]
    i = plan.robot.joints.index(joint) if joint is not None else 0
    j = i + 1 if i + 1 < plan.robot.n else i - 1
    values = effect.typical(
        JointScale(
            torque=float(size.torque[i]),
            speed=float(size.speed[i]),
            deflection=float(size.deflection[i]),
            stiffness=float(plan.model.stiffness[i]),
            motor_inertia=float(plan.model.motor_inertia[i]),
            neighbour_inertia=float(plan.model.motor_inertia[j]),
            position=float(plan.groups[0].reference.sample(np.zeros(1))[0][0, i]),
            duration=plan.groups[0].duration,
            viscous=float(plan.model.link_viscous_friction[i] + plan.model.motor_viscous_friction[i]),
        )
    )
    if not is_user_defined(name):  # examples of user-defined effects are not rounded
        values = tuple(float(f"{value:.3g}") for value in values)
    return dict(zip(effect.units, values, strict=True))


def motion_scale(plan: Plan) -> MotionScale:
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
    return MotionScale(torque, speed, torque / plan.model.stiffness)


def heaviest(plan: Plan) -> str:
    """The payload with the most mass."""
    name = max(plan.payloads, key=lambda each: mass(plan, each))
    if not mass(plan, name):
        raise InputError("payload_error needs a payload with a mass, this set has none")
    return name


def mass(plan: Plan, payload: str) -> float:
    """Of a payload with all its bodies [kg]."""
    return sum(body.mass for body in plan.payloads[payload])


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


def _check_values(text: str, effect: Effect, values: dict[str, float]) -> None:
    law = LAWS.get(effect.name)
    for p in effect.parameters:
        value, wanted = values[p.name], ""
        if not isfinite(value):
            raise InputError(f'effect "{text}": {p.name} is {value}, expected a finite number')
        if law is None and not p.lower <= value <= p.upper:
            wanted = f"{p.lower:g} to {p.upper:g}"
        elif law is not None and p.name in law.positive and value <= 0:
            wanted = "a positive number"
        elif law is not None and p.name in law.not_negative and value < 0:
            wanted = "a number ≥ 0"
        if wanted:
            raise InputError(f'effect "{text}": {p.name} is {value:g}, expected {wanted}')


def _check_episode(text: str, effect: Effect, values: dict[str, float], duration: float) -> None:
    """An episode begins before it ends, and some of it lies within its group, which lasts `duration` [s]."""
    _, start, end = (values[p.name] for p in effect.parameters)
    if not (start < end and start < duration and end > 0):
        raise InputError(
            f'effect "{text}": it lasts from {start:g} to {end:g} s, expected a start before the end, '
            f"within the {duration:g} s of its group"
        )
