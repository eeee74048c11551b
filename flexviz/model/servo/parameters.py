"""Parameters of a joint that follows goals: the law of its servo, and the friction behind it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexviz.base.arrays import Array

Kind = Literal["log", "size", "free"]
"""Fitted as its logarithm; as it is and not negative; or of either sign."""


@dataclass(frozen=True)
class ServoParameter:
    """One parameter of a joint.

    Attributes:
        name: as in `FlexibleModel` or, of an effect, "effect.parameter".
        kind: how it is fitted.
        absent: value with which it has no influence.
        tried: values from which a fit may start; of a limit, shares of the samples that stay below it.
        spread: standard deviation of what is likely, in units of what is fitted.
        shared: joints with the same servo have the same.
        torque: `tried` and `spread` are in units of the torque that the joint usually has.
        stiffer: from this one of `tried` on, with a gain some times as large.
    """

    name: str
    kind: Kind
    absent: float
    tried: tuple[float, ...]
    spread: float
    shared: bool = True
    torque: bool = False
    stiffer: int = 0


WIDE = float(np.log(10.0))  # nobody knows more than the order of magnitude
FREE = 30.0  # times the usual torque: no limit at all
DEGREE = 0.0175  # [rad] by which a joint's zero may be off
PARAMETERS = (
    ServoParameter("gain", "log", 1.0, (10.0,), 2 * WIDE),  # [Nm/rad]
    ServoParameter("motor_inertia", "log", 1.0, (0.02,), 2 * WIDE),  # [kg m²]
    ServoParameter("motor_viscous_friction", "log", 1.0, (0.5,), 2 * WIDE),  # [Nm s/rad]
    ServoParameter("coulomb_friction.coulomb", "size", 0.0, (0.03, 0.1, 0.3, 1.0), FREE, torque=True),
    ServoParameter("load_dependent_friction.coefficient", "size", 0.0, (0.1, 0.5), 0.5),
    ServoParameter("driving_friction.motor_driving", "size", 0.0, (0.1, 0.5), 0.5),
    ServoParameter("driving_friction.load_driving", "size", 0.0, (0.3, 0.1), 0.5),
    ServoParameter("stribeck_friction.stribeck", "size", 0.0, (0.2, 0.2, 0.2), FREE, torque=True),
    ServoParameter("stribeck_friction.velocity", "log", 1.0, (0.03, 0.1, 0.3), WIDE / 2),
    ServoParameter("quadratic_friction.quadratic", "size", 0.0, (0.03, 0.3), FREE, torque=True),
    ServoParameter("torque_offset.offset", "free", 0.0, (-0.005, 0.005), DEGREE, False),  # [rad] times kp
    ServoParameter("cable_spring.stiffness", "free", 0.0, (-0.2, 0.2), FREE, False, torque=True),
    ServoParameter("torque_limit.limit", "log", np.inf, (0.5, 0.8, 0.95, 0.5, 0.8, 0.95), WIDE, stiffer=3),
    ServoParameter("goal_delay.delay", "size", 0.0, (0.01, 0.02, 0.04), 0.03),
    ServoParameter("dead_band.half_width", "size", 0.0, (0.002, 0.005, 0.01), 0.01),
    ServoParameter("goal_lag.time_constant", "size", 0.0, (0.01, 0.03, 0.06), 0.03),
    ServoParameter("goal_speed_limit.speed", "log", np.inf, (0.5, 0.7, 0.85, 0.95), WIDE),
)
NAMES = tuple(p.name for p in PARAMETERS)
INDEX = {name: k for k, name in enumerate(NAMES)}
LOG = np.array([p.kind == "log" for p in PARAMETERS])
SIZE = np.array([p.kind == "size" for p in PARAMETERS])
SPREAD = np.array([p.spread for p in PARAMETERS])
ABSENT = np.array([p.absent for p in PARAMETERS])
START = np.array([p.tried[0] for p in PARAMETERS])
TORQUE = np.array([p.torque for p in PARAMETERS])
SHARED = np.array([p.shared for p in PARAMETERS])
OWN = ("gain", "motor_inertia", "motor_viscous_friction")  # that every joint has


def of_effect(effect: str) -> tuple[int, ...]:
    """Places of the parameters of an effect."""
    return tuple(k for k, name in enumerate(NAMES) if name.startswith(effect + "."))


SERVO_EFFECTS = tuple(dict.fromkeys(name.split(".")[0] for name in NAMES if "." in name))


CENTER = np.where(LOG, np.log(np.where(LOG, START, 1.0)), 0.0)
"""What is likely, of what is fitted; of limits in units of what the data have."""
SCALED = np.isin(NAMES, (*OWN, "torque_limit.limit")) | TORQUE
"""Those that have a scale in common: torques, and what makes them of a motion."""
RIVALS = (
    ("torque_limit", "goal_delay", "goal_lag", "goal_speed_limit", "dead_band"),
    (
        "coulomb_friction",
        "load_dependent_friction",
        "driving_friction",
        "stribeck_friction",
        "quadratic_friction",
    ),
    ("torque_offset", "cable_spring"),
    ("dead_band", "coulomb_friction", "stribeck_friction"),  # all leave a joint beside its goal
)
"""Effects that may be taken for each other."""


def rivals_of(effect: str) -> tuple[str, ...]:
    """Effects for which one may be taken, itself among them."""
    return tuple(dict.fromkeys(name for names in RIVALS if effect in names for name in names))


def absent(n: int) -> Array:
    """Values (P, n) of n joints without any effect, with rough own parameters."""
    values = np.repeat(ABSENT[:, None], n, axis=1)
    for name in OWN:
        values[INDEX[name]] = START[INDEX[name]]
    return values


def load_dependent(values: Array) -> Array:
    """Values (P, n) of driving-dependent friction as load-dependent friction that does the same.

    With forth m and back l the servo's torque is (1 + m) or (1 − l) times the load. By one factor of all
    torques, these are 1 + c and 1 − c.
    """
    out = values.copy()
    forth, back = (values[INDEX[f"driving_friction.{way}_driving"]] for way in ("motor", "load"))
    factor = (2.0 + forth - back) / 2.0
    out[SCALED] = np.where(np.isfinite(values[SCALED]), values[SCALED] / factor, values[SCALED])
    out[INDEX["load_dependent_friction.coefficient"]] += (forth + back) / (2.0 * factor)
    return out


CASES: Mapping[tuple[str, str], Callable[[Array], Array]] = {
    ("driving_friction", "load_dependent_friction"): load_dependent,
}
"""An effect, and another that is a case of it -> values with which the latter moves the joint alike."""
