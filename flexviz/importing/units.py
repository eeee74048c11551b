"""Units a mapping may name, as factors to SI, and what they mean for a joint's angle and torque."""

from __future__ import annotations

import math
import re

ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "rev": 2 * math.pi}  # -> [rad]
TORQUE = {"Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "kNm": 1e3}  # -> [Nm]
CURRENT = {"A": 1.0, "mA": 1e-3}  # -> [A]; Nm with the torque constant
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # -> [s]

# what people write for them in headers, compared without case, spaces and · *
_SPELLINGS = {
    "rad": ("rad", "rads", "radian", "radians"),
    "mrad": ("mrad",),
    "deg": ("deg", "degs", "degree", "degrees", "°", "grad"),
    "rev": ("rev", "revs", "revolutions", "turn", "turns", "rot", "rotations"),
    "Nm": ("nm", "n-m", "n.m", "newtonmeter", "newtonmetre"),
    "mNm": ("mnm", "mn-m", "mn.m"),
    "Ncm": ("ncm",),
    "kNm": ("knm",),
    "A": ("a", "amp", "amps", "ampere", "amperes", "arms", "apk"),
    "mA": ("ma", "milliamp", "milliamps"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "millis", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanoseconds"),
}
SPELLING = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
# endings that also are words of their own ("position_a", "angle_s") are no units without brackets
_NEED_BRACKETS = frozenset({"a", "s", "rot", "turn", "rev", "grad"})


def unit_in(text: str) -> str | None:
    """The unit that the end of a column's name states: "q1_deg", "I1 [A]"."""
    bracketed = re.search(r"[\[(]([^\])]*)[\])]\s*$", text)
    if bracketed:
        return known_unit(bracketed[1])
    last = re.split(r"[\s_./-]+", text.strip())[-1]
    return None if last.lower() in _NEED_BRACKETS or last == text.strip() else known_unit(last)


def known_unit(text: str) -> str | None:
    """The unit that a spelling stands for."""
    return SPELLING.get(re.sub(r"[\s·*⋅]", "", text).lower())
