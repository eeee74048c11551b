"""What a value from a browser must be before anything acts on it. No viser here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from flexviz.errors import InputError

Kind = Literal["number", "choice", "switch", "press", "text", "range", "none"]
LONGEST_TEXT = 2000
LARGEST = 2**63


@dataclass(frozen=True)
class Rule:
    """What a control accepts.

    Attributes
    ----------
    kind: "number", "choice" (one of `options`), "switch" (true or false), "press" (a button), "text",
        "range" (`length` increasing numbers), or "none" (nothing at all).
    low, high: limits of numbers.
    whole: True where only whole numbers are accepted.
    options: what may be chosen.
    length: how many numbers a range has.
    disabled: True while the control is greyed out.
    """

    kind: Kind
    low: float = -math.inf
    high: float = math.inf
    whole: bool = False
    options: Sequence[str] = ()
    length: int = 0
    disabled: bool = False


def check(rule: Rule, value: Any) -> Any:
    """`value` as the control's own type; InputError where it is not acceptable."""
    if rule.disabled:
        raise InputError("the control is disabled")
    if rule.kind == "number":
        return _number(rule, value)
    if rule.kind == "choice":
        if not isinstance(value, str) or value not in rule.options:
            raise InputError(f"{_shown(value)} is not one of the {len(rule.options)} options")
        return value
    if rule.kind == "switch":
        if not isinstance(value, bool):
            raise InputError(f"{_shown(value)} is not true or false")
        return value
    if rule.kind == "press":
        if value is not True:
            raise InputError(f"a button is pressed with true, not {_shown(value)}")
        return value
    if rule.kind == "text":
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise InputError(f"not a text of at most {LONGEST_TEXT} characters")
        return value
    if rule.kind == "range":
        if not isinstance(value, list | tuple) or len(value) != rule.length:
            raise InputError(f"{_shown(value)} is not a list of {rule.length} numbers")
        numbers = tuple(_number(rule, item) for item in value)
        if list(numbers) != sorted(numbers):
            raise InputError(f"{_shown(value)} does not increase")
        return numbers
    raise InputError("this control takes no value")


def _number(rule: Rule, value: Any) -> float | int:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{_shown(value)} is not a number")
    if isinstance(value, int) and abs(value) > LARGEST:
        raise InputError("the number is too large")
    if not math.isfinite(value):
        raise InputError(f"{_shown(value)} is not finite")
    slack = 1e-9 * max(abs(rule.low), abs(rule.high), 1.0) if math.isfinite(rule.low + rule.high) else 0.0
    if not rule.low - slack <= value <= rule.high + slack:
        raise InputError(f"{_shown(value)} is not between {rule.low:g} and {rule.high:g}")
    if rule.whole:
        if value != int(value):
            raise InputError(f"{_shown(value)} is not a whole number")
        return int(value)
    return min(max(float(value), rule.low), rule.high)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"
