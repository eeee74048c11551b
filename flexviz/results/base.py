"""Verdicts, grades and notes of a result; base class and nullable numbers of a document's entries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

Verdict = Literal["missing", "nothing-missing", "unknown"]
Grade = Literal["yes", "weak", "no"]
NoteKind = Literal[
    "model-error",
    "pulses",
    "unexplained",
    "changing",
    "place",
    "unbiased",
    "free-curve",
    "stopgap",
    "bandwidth",
    "standstill",
    "filtered",
    "explained",
    "noise",
    "other",
]


@dataclass(frozen=True)
class Note:
    """A remark on a diagnosis in one sentence.

    Kinds: "model-error" (effects were judged despite a model error), "pulses" (the error occurs at
    reversals), "unexplained" (remaining error), "changing" (the size of an effect changes with time),
    "place" (where an unknown law acts), "unbiased" (parameters that it does not bias), "free-curve" (error
    that a free curve would absorb), "stopgap" (free curves in the model), "bandwidth" (values that change
    with the observer bandwidth), "standstill" (joints whose rest is judged apart), "explained" (share of
    each joint's torque that the model explains), "noise" (share of it that is noise), "other".
    """

    kind: NoteKind
    text: str


def nullable(value: Any, info: ValidationInfo) -> Any:
    """Numbers and arrays of a record with None for what is not finite; files are left to the strict check."""
    if info.mode == "json":
        return value
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [nullable(item, info) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


Number = Annotated[float, Field(allow_inf_nan=False)]
Nullable = Annotated[Number | None, BeforeValidator(nullable)]
Column = Annotated[list[Number | None], BeforeValidator(nullable)]
Rows = Annotated[list[Column], BeforeValidator(nullable)]
Counts = Annotated[list[list[int]], BeforeValidator(nullable)]


def check_lengths(expected: int, what: str, **lists: Sequence[Any] | None) -> None:
    """Refuse lists of another length, naming the first; None is let through."""
    for name, values in lists.items():
        if values is not None and len(values) != expected:
            found = {"name": name, "found": len(values), "expected": expected, "what": what}
            raise PydanticCustomError(
                "length", "{name} has {found} values, expected {expected}, {what}", found
            )


class ResultEntry(BaseModel):
    """Part of a document; a record gives its fields by attributes, or a tuple in their order."""

    model_config = ConfigDict(
        extra="ignore", frozen=True, from_attributes=True, populate_by_name=True, defer_build=True
    )

    @model_validator(mode="before")
    @classmethod
    def _from_tuple(cls, data: Any) -> Any:
        return dict(zip(cls.model_fields, data, strict=False)) if isinstance(data, tuple) else data
