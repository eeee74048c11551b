"""Conversion of results to JSON and arrays and back, for the classes listed here; nothing is executed.

A dataclass becomes {"=": its name, field: value, …}, an array {"#": its number}, a tuple a list; results that
several steps share are written once and referred to as {"@": number}.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.diagnosis import (
    Absorbed,
    BandwidthCheck,
    Diagnosis,
    Evidence,
    Finding,
    FreeCurve,
    ParameterCurve,
    ResidualLocation,
    ResidualMap,
    Tie,
)
from flexviz.diagnosis import Step as DiagnosisStep
from flexviz.errors import InputError
from flexviz.identification import (
    Combination,
    Identification,
    ParameterEstimate,
    ResidualSeries,
    ResidualSummary,
)
from flexviz.model import EffectValue, FlexibleModel
from flexviz.progress import Iteration
from flexviz.results import Note
from flexviz.session.state import Analysis, ModelStep, SessionNote, SessionStep

KINDS: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        Absorbed, Analysis, Combination, Diagnosis, EffectValue, Evidence, Finding, FlexibleModel, FreeCurve,
        BandwidthCheck, Identification, Iteration, Note, ParameterCurve, ParameterEstimate, ResidualLocation,
        ResidualMap, ResidualSeries, ResidualSummary, ModelStep, SessionNote, SessionStep, Tie,
    )
} | {"DiagnosisStep": DiagnosisStep}  # fmt: skip
NAMES = {kind: name for name, kind in KINDS.items()}
SHARED = (Identification, Diagnosis, DiagnosisStep)  # written once
MAX_DEPTH = 40  # of nested values


class Packer:
    """Converts objects to JSON; collects the numbered arrays and shared values."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder  # written as ".": a session may be moved
        self.arrays: list[np.ndarray] = []
        self.shared: list[Any] = []
        self._numbers: dict[int, int] = {}
        self._kept: list[Any] = []
        self._depth = 0  # of nested shared values
        self._bounds: list[int] = [0]  # array numbers at which outermost shared values begin and end

    def parts(self) -> list[list[np.ndarray]]:
        """All arrays in order, split into one list per result."""
        bounds = [*self._bounds, len(self.arrays)]
        return [self.arrays[first:last] for first, last in pairwise(bounds) if last > first]

    def pack(self, value: Any) -> Any:
        """The value as JSON."""
        if value is None or isinstance(value, bool | str):
            return value
        if isinstance(value, Path):
            return {"/": "." if value == self._folder else str(value)}
        if isinstance(value, int | np.integer):
            return int(value)
        if isinstance(value, float | np.floating):
            return float(value) if math.isfinite(value) else {"~": str(float(value))}
        if isinstance(value, np.ndarray):
            self.arrays.append(value)
            return {"#": len(self.arrays) - 1}
        if isinstance(value, Mapping):
            return {"{": [[self.pack(k), self.pack(v)] for k, v in value.items()]}
        if isinstance(value, tuple | list):
            return [self.pack(item) for item in value]
        if is_dataclass(value) and type(value) in NAMES:
            return self._object(value)
        raise InputError(f"a {type(value).__name__} cannot be saved in a session")

    def _object(self, value: Any) -> Any:
        if not isinstance(value, SHARED):
            return self._fields(value)
        if id(value) not in self._numbers:
            outermost = self._depth == 0
            if outermost:
                self._bounds.append(len(self.arrays))
            self._depth += 1
            packed = self._fields(value)
            self._depth -= 1
            if outermost:
                self._bounds.append(len(self.arrays))
            self._kept.append(value)  # keeps its id unique
            self._numbers[id(value)] = len(self.shared)
            self.shared.append(packed)
        return {"@": self._numbers[id(value)]}

    def _fields(self, value: Any) -> Any:
        entries = {field.name: self.pack(getattr(value, field.name)) for field in fields(value) if field.init}
        return {"=": NAMES[type(value)], **entries}


class Unpacker:
    """Converts JSON back to objects; InputError for anything that `Packer` does not write."""

    def __init__(self, folder: Path, arrays: Sequence[np.ndarray], shared: Sequence[Any]) -> None:
        self._folder = folder
        self._arrays = arrays
        self._shared: list[Any] = []
        for packed in shared:  # each refers to earlier ones only
            self._shared.append(self.unpack(packed))

    def unpack(self, value: Any, depth: int = 0) -> Any:
        """The object that this JSON describes."""
        if depth > MAX_DEPTH:
            raise InputError("values are nested too deeply")
        if value is None or isinstance(value, bool | str | int | float):
            return value
        if isinstance(value, list):
            return tuple(self.unpack(item, depth + 1) for item in value)
        if not isinstance(value, dict):
            raise InputError(f"{type(value).__name__} is not allowed in a session")
        if "=" in value:
            return self._object(value, depth)
        if len(value) != 1:
            raise InputError("an entry with several keys, expected one")
        (mark, inner), *_ = value.items()
        if mark == "#":
            return self._arrays[_index(inner, self._arrays)]
        if mark == "@":
            return self._shared[_index(inner, self._shared)]
        if mark == "~" and inner in ("nan", "inf", "-inf"):
            return float(inner)
        if mark == "/" and isinstance(inner, str):
            return self._folder if inner == "." else Path(inner)
        if (
            mark == "{"
            and isinstance(inner, list)
            and all(isinstance(p, list) and len(p) == 2 for p in inner)
        ):
            return {self.unpack(k, depth + 1): self.unpack(v, depth + 1) for k, v in inner}
        raise InputError(f"unknown kind of entry {mark!r}")

    def _object(self, value: dict[str, Any], depth: int) -> Any:
        name = value["="]
        kind = KINDS.get(name) if isinstance(name, str) else None
        if kind is None:
            raise InputError(f"{name!r} is not a class of a session")
        known = {field.name: field for field in fields(kind) if field.init}
        given = {key: self.unpack(v, depth + 1) for key, v in value.items() if key in known}
        missing = [
            key
            for key, field in known.items()
            if key not in given and field.default is MISSING and field.default_factory is MISSING
        ]
        if missing:
            raise InputError(f"{name} lacks {', '.join(missing)}: written by another version")
        try:
            return kind(**given)
        except (TypeError, ValueError) as error:
            raise InputError(f"{name} cannot be read: {error}") from None


def _index(number: Any, of: Sequence[Any]) -> int:
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < len(of):
        raise InputError("reference {number!r} is out of range")
    return number
