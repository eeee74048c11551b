"""Verdicts, grades and notes of a result; base class and nullable numbers of a document's entries."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator

Verdict = Literal["missing", "nothing-missing", "unknown"]
Grade = Literal["yes", "weak", "no"]
NoteKind = Literal[
    "model-error",
    "pulses",
    "unexplained",
    "free-curve",
    "stopgap",
    "bandwidth",
    "standstill",
    "explained",
    "other",
]


@dataclass(frozen=True)
class Note:
    """A remark on a diagnosis in one sentence.

    Kinds: "model-error" (effects were judged despite a model error), "pulses" (the error occurs at
    reversals), "unexplained" (remaining error), "free-curve" (error that a free curve would absorb),
    "stopgap" (free curves in the model), "bandwidth" (values that change with the observer bandwidth),
    "standstill" (joints whose rest is judged apart), "explained" (share of each joint's torque that the model
    explains), "other".
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


class ResultEntry(BaseModel):
    """Part of a document; a record gives its fields by attributes, or a tuple in their order."""

    model_config = ConfigDict(extra="ignore", frozen=True, from_attributes=True, populate_by_name=True)

    @model_validator(mode="before")
    @classmethod
    def _from_tuple(cls, data: Any) -> Any:
        return dict(zip(cls.model_fields, data, strict=False)) if isinstance(data, tuple) else data
