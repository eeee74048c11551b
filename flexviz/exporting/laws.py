"""A model's parameters for the exporters: arrays with one number per joint, and rows of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.exporting.coverage import CODE, EVENT, USER_DEFINED, LeftOut, PerJoint, PerRow
from flexviz.model import EffectValue, FlexibleModel
from flexviz.robot import GRAVITY, PayloadBody, Robot
from flexviz.simulation import check_effect, neighbour, scaled_body, tilted_gravity

Array = NDArray[np.float64]
Row = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Laws:
    """The model's parameters in the set's joint order; zero disables an effect.

    Attributes:
        base: (n,) arrays: stiffness [Nm/rad], motor_inertia [kg m²], motor_viscous, link_viscous [Nm s/rad].
        tables: (n,) arrays of the `PerJoint` effects, by table, units as registered. The cable spring's
            torque is spring q − spring_torque [Nm].
        rows: rows of the `PerRow` effects, by table: joint indices, then the numbers.
        gravity: (3,) [m/s²] in the base's frame.
        bodies: the payload's bodies as identified.
    """

    base: Mapping[str, Array]
    tables: Mapping[str, Array]
    rows: Mapping[str, list[Row]]
    gravity: tuple[float, float, float] = GRAVITY
    bodies: tuple[PayloadBody, ...] = ()

    def __getitem__(self, name: str) -> Array:
        """One of `base` or `tables`, (n,)."""
        return self.base[name] if name in self.base else self.tables[name]

    def sliding_friction(self, i: int) -> float:
        """Friction of joint i's motor while it slides: Coulomb and presliding [Nm]."""
        return float(self["motor_coulomb"][i] + sum(f for at, _, f in self.rows["presliding"] if at == i))


def laws(
    robot: Robot, model: FlexibleModel, payload: str | None = None, bodies: Sequence[PayloadBody] = ()
) -> Laws:
    """The laws of `model`, with the `bodies` of the set's payload `payload`.

    Raises:
        InputError: an effect's joint does not exist, or a value is impossible, such as a stiffness of zero.
    """
    n = robot.n
    tables = {code.table: np.zeros(n) for code in CODE.values() if isinstance(code, PerJoint)}
    tables["spring_torque"] = np.zeros(n)
    rows: dict[str, list[Row]] = {code.table: [] for code in CODE.values() if isinstance(code, PerRow)}
    gravity, carried = GRAVITY, tuple(bodies)
    for effect in model.effects:
        name, p, code = effect.effect, effect.parameters, CODE.get(effect.effect, USER_DEFINED)
        if isinstance(code, LeftOut) or not_of_robot(effect, payload):
            continue
        check_effect(effect, robot.joints)
        if name == "payload_error":
            carried = tuple(scaled_body(body, 1.0 + p["relative_mass_error"]) for body in carried)
        elif name == "base_tilt":
            gravity = tilted_gravity(p["tilt_x"], p["tilt_y"])
        for i in range(n) if effect.joint is None else (robot.joints.index(effect.joint),):
            if isinstance(code, PerJoint):
                tables[code.table][i] += p[code.parameter]
            elif isinstance(code, PerRow):
                indices = (i, neighbour(robot, int(robot.order[i]))) if "other" in code.joints else (i,)
                rows[code.table].append((*indices, *(p[k] for k in code.columns)))
            if name == "cable_spring":
                tables["spring_torque"][i] += p["stiffness"] * p["rest_angle"]
    base = {
        "stiffness": model.stiffness,
        "motor_inertia": model.motor_inertia,
        "motor_viscous": model.motor_viscous_friction,
        "link_viscous": model.link_viscous_friction,
    }
    found = Laws(base, tables, rows, gravity, carried)
    _check(found, robot.joints)
    return found


def not_of_robot(effect: EffectValue, payload: str | None) -> str:
    """Why an effect is not part of the exported robot, or ""."""
    if effect.group is not None:
        return EVENT.because
    if effect.payload not in (None, payload):
        return "belongs to a payload that is not exported (--payload)"
    return ""


def _check(found: Laws, joints: Sequence[str]) -> None:
    for i, joint in enumerate(joints):
        for name, unit in (("stiffness", "Nm/rad"), ("motor_inertia", "kg m²")):
            value = float(found[name][i])
            if not (np.isfinite(value) and value > 0.0):
                what = name.replace("_", " ")
                raise InputError(f"{what} of {joint} is {value:g} {unit}, expected a positive number")
        for name in ("cubic", "half_width", "damping"):
            if found[name][i] < 0.0:
                what, value = name.replace("_", " "), found[name][i]
                raise InputError(f"{what} of {joint} is {value:g}, expected zero or a positive number")
        swing = sum(abs(a * n) for at, a, n, _ in found.rows["error"] if at == i)
        if swing >= 1.0:
            raise InputError(
                f"transmission error of {joint}: amplitude times order is {swing:.3g}, expected less than 1: "
                "beyond that the link reverses while the motor goes on"
            )
    for i, stiffness, coulomb in found.rows["presliding"]:
        if not (stiffness > 0.0 and coulomb > 0.0):
            what = f"presliding_hysteresis of {joints[int(i)]}"
            raise InputError(
                f"{what}: stiffness {stiffness:g} and friction {coulomb:g}, expected positive numbers"
            )
