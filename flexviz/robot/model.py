"""Parameters of a flexible-joint robot model, as identified, simulated and saved."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.fields import Floats

INERTIAL_UNITS = {
    "mass": "kg", "mx": "kg m", "my": "kg m", "mz": "kg m",
    "ixx": "kg m²", "ixy": "kg m²", "iyy": "kg m²", "ixz": "kg m²", "iyz": "kg m²", "izz": "kg m²",
}  # fmt: skip
"""Name of an inertial parameter -> its unit, in the order of a row of `FlexibleModel.inertial`."""

JOINT_UNITS = {
    "stiffness": "Nm/rad", "motor_inertia": "kg m²",
    "link_viscous_friction": "Nm s/rad", "motor_viscous_friction": "Nm s/rad",
}  # fmt: skip
"""Name of a parameter that every joint has -> its unit on a joint that turns."""

_ARRAYS = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction", "inertial")


@dataclass(frozen=True)
class EffectValue:
    """An effect, its place, and its parameter values in SI units."""

    effect: str
    joint: str | None
    parameters: dict[str, float] = field(default_factory=dict)
    group: str | None = None
    payload: str | None = None

    @property
    def text(self) -> str:
        """Name and place: `coulomb_friction:joint1`, `payload_error:p2`, `external_contact:joint1@g2`."""
        place = self.joint or self.payload
        return self.effect + (f":{place}" if place else "") + (f"@{self.group}" if self.group else "")


@dataclass(frozen=True, eq=False)
class FlexibleModel:
    """Parameters of a flexible-joint robot at the joint side, in the joint order of the set.

    Attributes:
        joints: names of the n joints.
        stiffness: (n,) K [Nm/rad].
        motor_inertia: (n,) B [kg m²].
        link_viscous_friction, motor_viscous_friction: (n,) f_lv, f_mv [Nm s/rad].
        inertial: (n, 10) m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joint frame
            [kg, kg m, kg m²], without payload.
        effects: further effects with their values.
    """

    joints: tuple[str, ...]
    stiffness: Floats
    motor_inertia: Floats
    link_viscous_friction: Floats
    motor_viscous_friction: Floats
    inertial: Floats
    effects: tuple[EffectValue, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(self, "effects", tuple(self.effects))
        n = len(self.joints)
        for name in _ARRAYS:
            shape = (n, 10) if name == "inertial" else (n,)
            value: Any = np.array(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise InputError(f"{name} has shape {value.shape}, expected {shape} for {n} joints")
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)
