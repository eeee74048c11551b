"""Verdicts, grades and notes of a result; what its records and the entries of a document are made of."""

from __future__ import annotations

import math
from collections.abc import Sized
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

Verdict = Literal["missing", "nothing-missing", "unknown"]
Grade = Literal["yes", "weak", "no"]
NoteKind = Literal[
    "model-error",
    "pulses",
    "unexplained",
    "changing",
    "drowned",
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
    "drowned" (noise larger than the torque),
    "place" (where an unknown law acts), "unbiased" (parameters that it does not bias), "free-curve" (error
    that a free curve would absorb), "stopgap" (free curves in the model), "bandwidth" (values that change
    with the observer bandwidth), "standstill" (joints whose rest is judged apart), "explained" (share of
    each joint's torque that the model explains), "noise" (share of it that is noise), "other".
    """

    kind: NoteKind
    text: str


def nullable(value: Any, info: ValidationInfo) -> Any:
    """A number of a record, None if it is not finite; files are left to the strict check."""
    undefined = info.mode != "json" and isinstance(value, float) and not math.isfinite(value)
    return None if undefined else value


@dataclass(frozen=True)
class InJson:
    """Numbers of a record, NaN where undefined: in JSON a number or nested lists, with null.

    Attributes:
        form: type in JSON, against which files are checked.
        kind: type of the numbers.
    """

    form: Any
    kind: type = np.float64

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        form = handler.generate_schema(self.form)
        written = core_schema.plain_serializer_function_ser_schema(self.write, return_schema=form)
        return core_schema.with_info_wrap_validator_function(self.read, form, serialization=written)

    def read(self, value: Any, check: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        """The array, or the number, of a record or a file."""
        checked = check(value) if info.mode == "json" else value
        try:
            array = np.asarray(checked, self.kind)
        except (ValueError, OverflowError):
            raise PydanticCustomError("array", "expected numbers in rows of equal length") from None
        return array if array.ndim else array.item()

    def write(self, value: Any) -> Any:
        """What JSON holds of it."""
        return np.where(np.isfinite(value), value, np.array(None)).tolist()


Number = Annotated[float, Field(allow_inf_nan=False)]
Nullable = Annotated[Number | None, BeforeValidator(nullable)]
Real = Annotated[float, InJson(Number | None)]
Column = Annotated[NDArray[np.float64], InJson(list[Number | None])]  # shape (M,)
Rows = Annotated[NDArray[np.float64], InJson(list[list[Number | None]])]  # shape (S, M)
Counts = Annotated[NDArray[np.int64], InJson(list[list[int]], np.int64)]  # shape (S, M)
Flags = Annotated[NDArray[np.bool_], InJson(list[bool], np.bool_)]  # shape (M,)

RECORD = ConfigDict(
    extra="ignore", defer_build=True, validate_by_name=True, validate_by_alias=True, serialize_by_alias=True
)  # of a record, which is a pydantic dataclass


def check_lengths(expected: int, what: str, **lists: Sized | None) -> None:
    """Refuse lists of another length, naming the first; None is let through."""
    for name, values in lists.items():
        if values is not None and len(values) != expected:
            found = {"name": name, "found": len(values), "expected": expected, "what": what}
            raise PydanticCustomError(
                "length", "{name} has {found} values, expected {expected}, {what}", found
            )


class ResultEntry(BaseModel):
    """Part of a document; a record gives its fields by attributes."""

    model_config = ConfigDict(extra="ignore", frozen=True, from_attributes=True, defer_build=True)


class TupleEntry(ResultEntry):
    """Part of a document; a tuple gives its fields in their order.

    Nothing in it is a record with tuples: they refuse the lists that this check makes of JSON.
    """

    @model_validator(mode="before")
    @classmethod
    def _from_tuple(cls, data: Any) -> Any:
        return dict(zip(cls.model_fields, data, strict=False)) if isinstance(data, tuple) else data
