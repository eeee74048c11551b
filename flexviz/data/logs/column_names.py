"""Words and units in the names of columns: quantity, side of the gear, unit, commanded or measured."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": 2 * math.pi}  # -> [rad]
TORQUE = {"Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "kNm": 1e3}  # -> [Nm]
LENGTH = {"m": 1.0, "mm": 1e-3}  # -> [m]; positions of prismatic joints, as angles of others
FORCE = {"N": 1.0, "kN": 1e3}  # -> [N]
CURRENT = {"A": 1.0, "mA": 1e-3}  # -> [A]; Nm with the torque constant
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # -> [s]

# spellings found in headers, compared without case, spaces and · *
_SPELLINGS = {
    "rad": ("rad", "rads", "radian", "radians"),
    "mrad": ("mrad",),
    "deg": ("deg", "degs", "degree", "degrees", "°", "grad"),
    "rev": ("rev", "revs", "revolutions", "turn", "turns", "rot", "rotations"),
    "Nm": ("nm", "n-m", "n.m", "newtonmeter", "newtonmetre"),
    "mNm": ("mnm", "mn-m", "mn.m"),
    "Ncm": ("ncm",),
    "kNm": ("knm",),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "mm": ("mm", "millimeter", "millimeters"),
    "N": ("n", "newton"),
    "kN": ("kn",),
    "A": ("a", "amp", "amps", "ampere", "amperes", "arms", "apk"),
    "mA": ("ma", "milliamp", "milliamps"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millis", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanoseconds"),
}
SPELLING = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
# endings that are also words ("position_a", "angle_s") are no units without brackets
_NEED_BRACKETS = frozenset({"a", "s", "m", "n", "rot", "turn", "rev", "grad"})


Quantity = Literal["position", "velocity", "acceleration", "torque", "current", "other"]
Side = Literal["motor", "link"]

# The last word that names a quantity decides ("motor_position_effort" is an effort); words of other meaning
# ("d", "i", "q") only count where there is no clear one.
CLEAR_WORDS: dict[Quantity, str] = {
    "position": "pos position positions theta angle angles ang phi encoder enc qpos winkel",
    "velocity": "vel velocity velocities speed speeds omega dtheta thetadot qdot rpm dot qvel",
    "acceleration": "acc accel acceleration accelerations qddot ddot",
    "torque": "tau torque torques trq effort efforts eff moment moments drehmoment load",
    "current": "current currents curr amps strom",
    "other": "temp temperature volt voltage pose tcp status mode error err temperatur power pwm enable",
}
VAGUE_WORDS: dict[Quantity, str] = {
    "position": "q th state qm ql",
    "velocity": "dq qd dth w",
    "acceleration": "ddq qdd ddth",
    "torque": "t m u mom",
    "current": "i iq cur amp",
}
REFERENCE_WORDS = "ref reference des desired target cmd command commanded commands goal setpoint sp action "
ROLES = {
    "reference": {*REFERENCE_WORDS.split(), "soll", "nominal", "d"},
    "motor": set(["motor", "motors", "mot", "rotor", "drive", "drives", "actuator", "qm"]),
    "link": set(["link", "links", "output", "secondary", "arm", "ql"]),
    "measured": {"act", "actual", "meas", "measured", "msr", "ist"},
    "computed": {"g", "grav", "gravity", "model", "calc", "calculated", "computed", "predicted", "coriolis"},
    "sensor": set(["sensor", "sensors", "ext", "external", "jts", "strain"]),
}


def _by_word(words_of: dict[Quantity, str]) -> dict[str, Quantity]:
    return {word: quantity for quantity, text in words_of.items() for word in text.split()}


CLEAR, VAGUE = _by_word(CLEAR_WORDS), _by_word(VAGUE_WORDS)


QUANTITY_OF = _by_word(
    {"torque": " ".join(TORQUE), "current": " ".join(CURRENT), "position": " ".join(ANGLE)}
)
_INDEX = re.compile(r"[\d:,\s]*")
_UNIT_AT_END = re.compile(r"[\[(]([^\])]*)[\])]\s*$")  # in brackets


@dataclass(frozen=True)
class Meaning:
    """The meaning of a column's name."""

    quantity: Quantity  # what was measured
    reference: bool = False  # commanded, not measured
    side: Side | None = None  # of the gear and the spring; None where the name does not tell
    sensor: bool = False  # measured by a sensor at the joint
    unit: str | None = None  # the unit that the name or the file states
    measured: bool = False  # said to be measured
    computed: bool = False  # a torque computed from a model, such as gravity's


def words(name: str) -> list[str]:
    """Lower-case words and numbers of a name: "actual_qDot[3]" -> actual, q, dot, 3."""
    parts = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return re.findall(r"[^\W\d_]+|\d+", parts.lower())


def without_unit(name: str) -> str:
    """A name without a unit in brackets at its end (but with MATLAB's and Python's indices)."""
    stated = _UNIT_AT_END.search(name)
    return name if stated is None or _INDEX.fullmatch(stated[1]) else name[: stated.start()]


def meaning(said: Sequence[str], unit: str | None = None) -> Meaning:
    """What the words of a name (without those of the joint) mean; `unit` is the unit that it states."""
    pairs = [a + b for a, b in pairwise(said)]
    clear: list[Quantity] = [CLEAR[word] for word in (*said, *pairs) if word in CLEAR]
    vague: list[Quantity] = [VAGUE[word] for word in said if word in VAGUE]
    quantity: Quantity = clear[-1] if clear else vague[-1] if vague else "other"
    measured = QUANTITY_OF.get(unit or "")
    # a stated unit says more than a single letter
    if measured and ((not clear and quantity != "velocity") or (quantity, measured) == ("torque", "current")):
        quantity = measured
    spoken, angle = set(said), quantity == "position"
    side: Side | None = "motor" if "theta" in spoken else None
    if spoken & ROLES["motor"] or (angle and "m" in spoken):
        side = "motor"
    elif spoken & ROLES["link"] or (angle and spoken & {"load", "l"}):
        side = "link"
    sensor = bool(spoken & ROLES["sensor"]) or "taujoint" in pairs
    reference, measured, computed = (bool(spoken & ROLES[x]) for x in ("reference", "measured", "computed"))
    return Meaning(quantity, reference, side, sensor, unit, measured, computed and quantity == "torque")


def unit_in(text: str) -> str | None:
    """The unit that the end of a column's name states: "q1_deg", "I1 [A]"."""
    bracketed = _UNIT_AT_END.search(text)
    if bracketed and _INDEX.fullmatch(bracketed[1]):
        text = text[: bracketed.start()]
    elif bracketed:
        return known_unit(bracketed[1])
    last = re.split(r"[\s_./-]+", text.strip())[-1]
    return None if last.lower() in _NEED_BRACKETS or last == text.strip() else known_unit(last)


def known_unit(text: str) -> str | None:
    """The unit that a spelling stands for."""
    return SPELLING.get(re.sub(r"[\s·*⋅]", "", text).lower())


def size_of(unit: str | float, known: dict[str, float]) -> float:
    """One unit in SI."""
    return known[unit] if isinstance(unit, str) else float(unit)
