"""What controls and uploads accept from browsers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import viser

from flexviz.base.errors import InputError
from flexviz.base.schemas import shown
from flexviz.outlets.app.uploads import LARGEST_UPLOAD

LONGEST_TEXT = 2000
LARGEST_INTEGER = 2**63
RUNNING_UPLOADS = 4  # at most, of all browsers
LONGEST_FILE_NAME = 400

Rule = Callable[[Any], Any]  # the value converted to the control's type; InputError if it is invalid


def rule_of(handle: Any) -> Rule:
    """The rule of a viser control; unknown and disabled ones accept nothing."""
    if getattr(handle, "disabled", False):
        return partial(nothing, why="the control is disabled")
    if isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle):
        low = -math.inf if handle.min is None else float(handle.min)
        high = math.inf if handle.max is None else float(handle.max)
        return partial(number, low=low, high=high, whole=isinstance(handle.value, int))
    if isinstance(handle, viser.GuiMultiSliderHandle):
        whole = all(isinstance(value, int) for value in handle.value)
        one = partial(number, low=float(handle.min), high=float(handle.max), whole=whole)
        return partial(increasing, one=one, count=len(handle.value))
    if isinstance(handle, viser.GuiDropdownHandle | viser.GuiButtonGroupHandle):
        return partial(choice, options=tuple(handle.options))
    if isinstance(handle, viser.GuiCheckboxHandle):
        return switch
    if isinstance(handle, viser.GuiButtonHandle):
        return press
    return text if isinstance(handle, viser.GuiTextHandle) else nothing


def number(value: Any, low: float = -math.inf, high: float = math.inf, whole: bool = False) -> float | int:
    """A number between `low` and `high`."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{shown(value)} is not a number")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise InputError("the number is too large")
    if not math.isfinite(value):
        raise InputError(f"{shown(value)} is not finite")
    slack = 1e-9 * max(abs(low), abs(high), 1.0) if math.isfinite(low + high) else 0.0
    if not low - slack <= value <= high + slack:
        raise InputError(f"{shown(value)} is not between {low:g} and {high:g}")
    if whole:
        if value != int(value):
            raise InputError(f"{shown(value)} is not a whole number")
        return int(value)
    return min(max(float(value), low), high)


def increasing(value: Any, one: Rule, count: int) -> tuple[Any, ...]:
    """`count` increasing numbers, each by the rule `one`."""
    if not isinstance(value, list | tuple) or len(value) != count:
        raise InputError(f"{shown(value)} is not a list of {count} numbers")
    numbers = tuple(one(item) for item in value)
    if list(numbers) != sorted(numbers):
        raise InputError(f"{shown(value)} does not increase")
    return numbers


def choice(value: Any, options: Sequence[str]) -> str:
    if not isinstance(value, str) or value not in options:
        raise InputError(f"{shown(value)} is not one of the {len(options)} options")
    return value


def switch(value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{shown(value)} is not true or false")
    return value


def press(value: Any) -> bool:
    if value is not True:
        raise InputError(f"a button is pressed with true, not {shown(value)}")
    return value


def text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_TEXT:
        raise InputError(f"not a text of at most {LONGEST_TEXT} characters")
    return value


def nothing(value: Any, why: str = "this control takes no value") -> Any:
    raise InputError(why)


def upload_refusal(handle: Any, message: Any, running: int) -> str:
    """Why an upload is refused, or ""."""
    if not isinstance(handle, viser.GuiUploadButtonHandle) or handle.disabled:
        return "nothing is uploaded here"
    size, parts = message.size_bytes, message.part_count
    if any(not isinstance(number, int) or isinstance(number, bool) for number in (size, parts)):
        return "size or count of parts is not a whole number"
    if not 0 <= size <= LARGEST_UPLOAD or not 0 <= parts <= size // 1024 + 1:
        return f"{size} bytes in {parts} parts; at most {LARGEST_UPLOAD} bytes are taken"
    if not isinstance(message.filename, str) or not 0 < len(message.filename) <= LONGEST_FILE_NAME:
        return "no usable file name"
    if not isinstance(message.transfer_uuid, str) or len(message.transfer_uuid) > 100:
        return "no usable transfer"
    return "" if running < RUNNING_UPLOADS else f"{running} uploads run already"
