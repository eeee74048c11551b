"""A model's parameters for the exporters: arrays with one number per joint, and rows of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.model.simulation import check_effect, neighbour
from flexviz.outlets.exporting.coverage import (
    CODE,
    EVENT,
    USER_DEFINED,
    LeftOut,
    OnGravity,
    OnPayload,
    PerJoint,
    PerRow,
)
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot

Row = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Laws:
    """The model's parameters in the set's joint order; zero disables an effect."""

    # (n,) stiffness [Nm/rad], motor_inertia [kg m²], motor_viscous, link_viscous [Nm s/rad], and those of the
    # `PerJoint` effects, by table, units as registered
    arrays: Mapping[str, Array]
    rows: Mapping[str, list[Row]]  # rows of the `PerRow` effects, by table: joint indices, then the numbers
    gravity: tuple[float, float, float]  # (3,) [m/s²] in the base's frame
    bodies: tuple[PayloadBody, ...] = ()  # the payload's bodies as identified

    def __getitem__(self, name: str) -> Array:
        """One of `arrays`, (n,)."""
        return self.arrays[name]

    def sliding_friction(self, i: int) -> float:
        """Friction of joint i's motor while it slides: Coulomb and presliding [Nm]."""
        return float(self["motor_coulomb"][i] + sum(f for at, _, f in self.rows["presliding"] if at == i))


def laws(
    robot: Robot, model: FlexibleModel, payload: str | None = None, bodies: Sequence[PayloadBody] = ()
) -> Laws:
    """The laws of `model`, with the `bodies` of the set's payload `payload`.

    InputError for a joint that does not exist or an impossible value, such as a stiffness of zero.
    """
    n = robot.n
    per_joint = [code for code in CODE.values() if isinstance(code, PerJoint)]
    arrays = {array.table: np.zeros(n) for code in per_joint for array in code.arrays}
    arrays |= {
        "stiffness": model.stiffness,
        "motor_inertia": model.motor_inertia,
        "motor_viscous": model.motor_viscous_friction,
        "link_viscous": model.link_viscous_friction,
    }
    rows: dict[str, list[Row]] = {code.table: [] for code in CODE.values() if isinstance(code, PerRow)}
    gravity, carried = robot.gravity, tuple(bodies)
    for effect in model.effects:
        p, code = effect.parameters, CODE.get(effect.effect, USER_DEFINED)
        if isinstance(code, LeftOut) or not_of_robot(effect, payload):
            continue
        check_effect(effect, robot.joints)
        joints = range(n) if effect.joint is None else (robot.joints.index(effect.joint),)
        match code:
            case OnPayload():
                carried = tuple(code.body(body, p) for body in carried)
            case OnGravity():
                gravity = code.gravity(p, robot.gravity)
            case PerJoint():
                for array in code.arrays:
                    arrays[array.table][list(joints)] += array.number(p)
            case PerRow():
                for i in joints:
                    indices = (i, neighbour(robot, int(robot.order[i]))) if "other" in code.joints else (i,)
                    rows[code.table].append((*indices, *(float(p[k]) for k in code.columns)))
            case _:
                raise InputError(
                    f"{effect.text}: the code has no place for {code}, expected one in coverage.py"
                )
    return _checked(Laws(arrays, rows, gravity, carried), robot.joints)


def not_of_robot(effect: EffectValue, payload: str | None) -> str:
    """Why an effect is not part of the exported robot, or ""."""
    if effect.group is not None:
        return EVENT.because
    if effect.payload not in (None, payload):
        return "belongs to a payload that is not exported (--payload)"
    return ""


def _checked(found: Laws, joints: Sequence[str]) -> Laws:
    """The laws; raises InputError for an impossible value."""
    positive = [("stiffness", "Nm/rad")]
    if found["motor_inertia"].any():  # none at all: τ is measured behind the gears
        positive.append(("motor inertia", "kg m²"))
    for i, joint in enumerate(joints):
        for name, unit in positive:
            value = float(found[name.replace(" ", "_")][i])
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{name} of {joint} is {value:g} {unit}, expected a positive number")
        for name in ("cubic", "half width", "damping"):
            value = float(found[name.replace(" ", "_")][i])
            if value < 0.0:
                raise InputError(f"{name} of {joint} is {value:g}, expected zero or a positive number")
        swing = sum(abs(a * n) for at, a, n, _ in found.rows["error"] if at == i)
        if swing >= 1.0:
            raise InputError(
                f"transmission error of {joint}: amplitude times order is {swing:.3g}, expected less than 1: "
                "beyond that the link reverses while the motor goes on"
            )
    for i, stiffness, coulomb in found.rows["presliding"]:
        if not (stiffness > 0.0 and coulomb > 0.0):
            raise InputError(
                f"presliding_hysteresis of {joints[int(i)]}: stiffness {stiffness:g} and friction "
                f"{coulomb:g}, expected positive numbers"
            )
    return found
