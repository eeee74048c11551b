"""What a column's name says: quantity, side of the gear, unit, and whether it was asked for or measured."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from flexviz.importing.units import ANGLE, CURRENT, TORQUE, unit_in

Quantity = Literal["position", "velocity", "acceleration", "torque", "current", "other"]
Side = Literal["motor", "link"]

# The last word of a name that says a quantity decides ("motor_position_effort" is an effort), and words that
# also mean other things ("d", "i", "q") only count where no clear one is there.
_CLEAR: dict[Quantity, str] = {
    "position": "pos position positions theta angle angles ang phi encoder enc qpos winkel",
    "velocity": "vel velocity velocities speed speeds omega dtheta thetadot qdot rpm dot qvel",
    "acceleration": "acc accel acceleration accelerations qddot ddot",
    "torque": "tau torque torques trq effort efforts eff moment moments drehmoment load",
    "current": "current currents curr amps strom",
    "other": "temp temperature volt voltage pose tcp status mode error err temperatur power pwm",
}
_VAGUE: dict[Quantity, str] = {
    "position": "q th state qm ql",
    "velocity": "dq qd dth w",
    "acceleration": "ddq qdd ddth",
    "torque": "t m u mom",
    "current": "i iq cur amp",
}
_REFERENCE = set(
    [
        "ref",
        "reference",
        "des",
        "desired",
        "target",
        "cmd",
        "command",
        "commanded",
        "commands",
        "goal",
        "setpoint",
        "sp",
        "action",
        "soll",
        "nominal",
        "d",
    ]
)
_MOTOR = set(["motor", "motors", "mot", "rotor", "drive", "drives", "actuator", "qm"])
_LINK = set(["link", "links", "load", "output", "secondary", "arm", "ql"])
_SENSOR = set(["sensor", "sensors", "ext", "external", "jts", "strain"])
CLEAR: dict[str, Quantity] = {word: quantity for quantity, text in _CLEAR.items() for word in text.split()}
VAGUE: dict[str, Quantity] = {word: quantity for quantity, text in _VAGUE.items() for word in text.split()}


@dataclass(frozen=True)
class Meaning:
    """What a name says.

    Attributes:
        quantity: of what.
        reference: it was asked for, not measured.
        side: of the gear and the spring; None where the name does not say.
        sensor: a sensor at the joint measured it.
        unit: the unit that the name or the file states.
    """

    quantity: Quantity
    reference: bool = False
    side: Side | None = None
    sensor: bool = False
    unit: str | None = None


def words(name: str) -> list[str]:
    """Lower-case words and numbers of a name: "actual_qDot[3]" -> actual, q, dot, 3."""
    parts = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return re.findall(r"[^\W\d_]+|\d+", parts.lower())


def without_unit(name: str) -> str:
    """A name without a unit in brackets at its end (but with MATLAB's and Python's indices)."""
    stated = re.search(r"[\[(]([^\])]*)[\])]\s*$", name)
    return name if stated is None or re.fullmatch(r"[\d:,\s]*", stated[1]) else name[: stated.start()]


def meaning(said: Sequence[str], unit: str | None = None) -> Meaning:
    """What the words of a name (without those of the joint) mean; `unit` is the unit that it states."""
    pairs = [a + b for a, b in pairwise(said)]
    clear: list[Quantity] = [
        CLEAR[word] for word in (*said, *(pair for pair in pairs if pair in CLEAR)) if word in CLEAR
    ]
    vague: list[Quantity] = [VAGUE[word] for word in said if word in VAGUE]
    quantity: Quantity = clear[-1] if clear else vague[-1] if vague else "other"
    if not clear and unit is not None:  # a stated unit says more than a single letter
        stated: Quantity = (
            "torque"
            if unit in TORQUE
            else "current"
            if unit in CURRENT
            else "position"
            if unit in ANGLE
            else "other"
        )
        quantity = quantity if stated in ("other", quantity) or quantity == "velocity" else stated
    elif quantity == "torque" and unit in CURRENT:
        quantity = "current"
    spoken = set(said)
    side: Side | None = None
    if spoken & _MOTOR or (quantity == "position" and "m" in spoken):
        side = "motor"
    elif spoken & (_LINK - {"load"}) or (quantity == "position" and spoken & {"load", "l"}):
        side = "link"
    elif "theta" in spoken:
        side = "motor"
    sensor = bool(spoken & _SENSOR) or "taujoint" in pairs
    return Meaning(quantity, bool(spoken & _REFERENCE), side, sensor, unit)


def stated_unit(name: str, beside: str | None = None) -> str | None:
    """The unit that a name ends with, or that the file states `beside` it."""
    return beside or unit_in(name)
