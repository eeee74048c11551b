"""How the records of a result hold their numbers and arrays, in memory, in documents and in sessions.

A record is a dataclass; one adapter of pydantic writes and reads it, so that a new field is one line. A
document has arrays as nested lists, with null for what is not finite. A session gives the adapter a context
(`flexviz.content.session.packing`), which takes arrays to files and writes what several states share once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sized
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializationInfo,
    TypeAdapter,
    ValidationInfo,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from flexviz.base.facts import Fact


def named(value: float) -> float | dict[str, str]:
    """A number, with the name of one that is not finite, in a session."""
    return value if math.isfinite(value) else {"~": str(value)}


def nullable(value: Any, info: ValidationInfo) -> Any:
    """A number of a record, None if it is not finite; files are left to the strict check."""
    undefined = info.mode != "json" and isinstance(value, float) and not math.isfinite(value)
    return None if undefined else value


@dataclass(frozen=True)
class InJson:
    """Numbers of a record, NaN where undefined: in JSON a number or nested lists, with null.

    Attributes:
        form: type in JSON, against which files are checked; any for arrays that only sessions have.
        kind: type of the numbers.
    """

    form: Any = Any
    kind: type = np.float64

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(self.write, info_arg=True)
        form = handler.generate_schema(self.form)
        return core_schema.with_info_wrap_validator_function(self.read, form, serialization=written)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return handler(schema["schema"])  # of the form

    def read(self, value: Any, check: Callable[[Any], Any], info: ValidationInfo) -> Any:
        """The array, or the number, of a record or a file."""
        if info.context is not None:
            value = info.context.array(value) if isinstance(value, dict) else value
            if isinstance(value, bool) or not isinstance(value, np.ndarray | float | int):
                raise PydanticCustomError("array", "expected numbers")
        elif info.mode == "json":
            value = check(value)
        try:
            array = np.asarray(value, self.kind)
        except (ValueError, OverflowError, TypeError):
            raise PydanticCustomError("array", "expected numbers in rows of equal length") from None
        return array if array.ndim else array.item()

    def write(self, value: Any, info: SerializationInfo) -> Any:
        """What JSON holds of it."""
        if info.context is not None:
            return info.context.keep(value) if isinstance(value, np.ndarray) else named(float(value))
        return np.where(np.isfinite(value), value, np.array(None)).tolist()


class Once:
    """A record that several states of a session share: written once and referred to by its number."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(value: Any, check: Callable[[Any], Any], info: ValidationInfo) -> Any:
            return check(value) if info.context is None else info.context.shared_value(source, value)

        def write(value: Any, pack: Callable[[Any], Any], info: SerializationInfo) -> Any:
            return pack(value) if info.context is None else info.context.once(value, pack)

        written = core_schema.wrap_serializer_function_ser_schema(write, info_arg=True)
        return core_schema.with_info_wrap_validator_function(read, handler(source), serialization=written)


class InSession:
    """The folder of the set, which a session may be moved with: "." in a session."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(path: Path, info: ValidationInfo) -> Path:
            return path if info.context is None else info.context.from_set(path)

        def write(path: Path, info: SerializationInfo) -> str:
            return str(path if info.context is None else info.context.in_set(path))

        written = core_schema.plain_serializer_function_ser_schema(write, info_arg=True)
        return core_schema.with_info_after_validator_function(read, handler(source), serialization=written)


@cache
def packed_fact() -> TypeAdapter[Fact]:
    """What writes a fact to a session, and reads it."""
    return TypeAdapter(Fact)


class InWords:
    """A fact, in a document its sentence; a text where a document or an older session was read."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(value: Any, check: Callable[[Any], Any], info: ValidationInfo) -> Any:
            if isinstance(value, Fact):
                return value
            packed = info.context is not None and isinstance(value, dict)
            return packed_fact().validate_python(value) if packed else check(value)

        def write(value: Fact | str, info: SerializationInfo) -> Any:
            if isinstance(value, Fact) and info.context is not None:
                return packed_fact().dump_python(value, mode="json")
            return str(value)

        written = core_schema.plain_serializer_function_ser_schema(write, info_arg=True)
        text = core_schema.str_schema()
        return core_schema.with_info_wrap_validator_function(read, text, serialization=written)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return handler(schema["schema"])  # of the text


Said = Annotated[Fact | str, InWords()]
Number = Annotated[float, Field(allow_inf_nan=False)]
Nullable = Annotated[Number | None, BeforeValidator(nullable)]
Real = Annotated[float, InJson(Number | None)]
Column = Annotated[NDArray[np.float64], InJson(list[Number | None])]  # shape (M,)
Rows = Annotated[NDArray[np.float64], InJson(list[list[Number | None]])]  # shape (S, M)
Counts = Annotated[NDArray[np.int64], InJson(list[list[int]], np.int64)]  # shape (S, M)
Flags = Annotated[NDArray[np.bool_], InJson(list[bool], np.bool_)]  # shape (M,)
Floats = Annotated[NDArray[np.float64], InJson()]  # of any shape, in no document
SetPath = Annotated[Path, InSession()]

RECORD = ConfigDict(
    extra="ignore", defer_build=True, validate_by_name=True, validate_by_alias=True, serialize_by_alias=True
)  # of a record that is a pydantic dataclass: checked also where it is made


def is_none(value: Any) -> bool:
    """For `exclude_if` of a key that a document has only where it says something."""
    return value is None


def check_lengths(expected: int, what: str, **lists: Sized | None) -> None:
    """Refuse lists of another length, naming the first; None is let through."""
    for name, values in lists.items():
        if values is not None and len(values) != expected:
            found = {"name": name, "found": len(values), "expected": expected, "what": what}
            raise PydanticCustomError(
                "length", "{name} has {found} values, expected {expected}, {what}", found
            )
