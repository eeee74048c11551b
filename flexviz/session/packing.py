"""Results of a session as JSON and arrays, for the classes listed here; nothing is executed.

The arrays of a result are one file, named by its content and written once. A dataclass becomes
{"=": its name, field: value, …}, an array {"#": its number}, a tuple a list; results that several steps share
are written once and referred to as {"@": number}.
"""

from __future__ import annotations

import hashlib
import io
import math
import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache, reduce
from itertools import pairwise
from pathlib import Path
from types import GenericAlias, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, InstanceOf, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from flexviz import diagnosis, identification
from flexviz.errors import InputError
from flexviz.files import remove_leftovers, write_whole
from flexviz.laws import LawThroughData
from flexviz.limits import LARGEST_UNPACKED, check_npz
from flexviz.measurements import readable
from flexviz.model import EffectValue, FlexibleModel
from flexviz.observers import EsoGains
from flexviz.progress import Iteration
from flexviz.results import Note
from flexviz.schemas import shown
from flexviz.session.state import Analysis, ModelStep, SessionNote, SessionStep

KINDS: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        Analysis, EffectValue, EsoGains, FlexibleModel, Iteration, LawThroughData, ModelStep, Note,
        SessionNote, SessionStep,
        diagnosis.Absorbed, diagnosis.BandwidthCheck, diagnosis.Diagnosis, diagnosis.Evidence,
        diagnosis.Family, diagnosis.Finding, diagnosis.FreeCurve, diagnosis.Move, diagnosis.ParameterCurve,
        diagnosis.ResidualLocation, diagnosis.ResidualMap, diagnosis.Tie,
        identification.Combination, identification.Identification, identification.ParameterEstimate,
        identification.ResidualSeries, identification.ResidualSummary,
    )
} | {"DiagnosisStep": diagnosis.Step}  # fmt: skip
NAMES = {kind: name for name, kind in KINDS.items()}
SHARED = (identification.Identification, diagnosis.Diagnosis, diagnosis.Step)  # written once
MAX_DEPTH = 40  # of nested values
FOLDER = "results"
_FILE = re.compile(rf"{FOLDER}/([0-9a-f]{{32}})\.npz")


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
            begin = len(self.arrays)
            self._depth += 1
            packed = self._fields(value)
            self._depth -= 1
            if not self._depth:
                self._bounds += [begin, len(self.arrays)]
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
        self.shared: list[Any] = []
        for packed in shared:  # each refers to earlier ones only
            self.shared.append(self.unpack(packed))

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
            return self.shared[_index(inner, self.shared)]
        if mark == "~" and inner in ("nan", "inf", "-inf"):
            return float(inner)
        if mark == "/" and isinstance(inner, str):
            return self._folder if inner == "." else Path(inner)
        pairs = isinstance(inner, list) and all(isinstance(p, list) and len(p) == 2 for p in inner)
        if mark == "{" and pairs:
            return {self.unpack(k, depth + 1): self.unpack(v, depth + 1) for k, v in inner}
        raise InputError(f"unknown kind of entry {mark!r}")

    def _object(self, value: dict[str, Any], depth: int) -> Any:
        name = value["="]
        kind = KINDS.get(name) if isinstance(name, str) else None
        if kind is None:
            raise InputError(f"{name!r} is not a class of a session")
        known = {field.name: field for field in fields(kind) if field.init}
        given = {key: self.unpack(v, depth + 1) for key, v in value.items() if key in known}
        needed = [k for k, f in known.items() if f.default is MISSING and f.default_factory is MISSING]
        if missing := [key for key in needed if key not in given]:
            raise InputError(f"{name} lacks {', '.join(missing)}: written by another version")
        try:
            return kind(**_checker(kind).validate_python(given))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            field = ".".join(map(str, first["loc"]))
            raise InputError(f"{name}.{field} is {shown(first['input'])}: {first['msg']}") from None
        except (TypeError, ValueError) as error:
            raise InputError(f"{name} cannot be read: {error}") from None


@cache
def _checker(kind: type) -> TypeAdapter[Any]:
    """Checks the fields of a class against its annotations, strictly."""
    hints = get_type_hints(kind, localns={"NDArray": NDArray, "np": np})
    types = {field.name: _instances(hints[field.name]) for field in fields(kind) if field.init}
    table: Any = TypedDict(kind.__name__, types, total=False)  # type: ignore[misc]
    table.__pydantic_config__ = ConfigDict(strict=True, arbitrary_types_allowed=True)
    return TypeAdapter(table)


def _instances(hint: Any) -> Any:
    """An annotation in which classes of results stand for their instances, which are checked already."""
    if isinstance(hint, type) and is_dataclass(hint):
        return InstanceOf[hint]
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (tuple, dict):
        return GenericAlias(origin, tuple(map(_instances, inside)))
    return reduce(operator.or_, map(_instances, inside)) if origin in (Union, UnionType) else hint


def _index(number: Any, of: Sequence[Any]) -> int:
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < len(of):
        raise InputError(f"reference {number!r} is out of range")
    return number


def digest(arrays: Sequence[np.ndarray]) -> str:
    """Hash of types, shapes and contents of the arrays, 32 hexadecimal digits."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype.str}{array.shape};".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()[:32]


def write_arrays(folder: Path, arrays: Sequence[np.ndarray]) -> dict[str, Any]:
    """Write arrays to a session folder unless they are there already; returns their entry."""
    for array in arrays:
        if array.dtype.hasobject:
            raise InputError("an array of objects cannot be saved in a session")
    if (total := sum(array.nbytes for array in arrays)) > LARGEST_UNPACKED:  # it could not be opened again
        message = f"a result of {total:,} bytes cannot be saved in a session, expected at most"
        raise InputError(f"{message} {LARGEST_UNPACKED:,}")
    name = f"{FOLDER}/{digest(arrays)}.npz"
    if not (folder / name).is_file():
        (folder / FOLDER).mkdir(exist_ok=True)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **{f"a{i}": array for i, array in enumerate(arrays)})  # type: ignore[arg-type]
        write_whole(folder / name, buffer.getvalue())
    return {"file": name, "count": len(arrays)}


def read_arrays(folder: Path, entry: Any) -> list[np.ndarray]:
    """The arrays of an entry made by `write_arrays`; InputError if damaged, OSError if missing."""
    name, count = entry.get("file"), entry.get("count")
    found = _FILE.fullmatch(name) if isinstance(name, str) else None
    if found is None or not isinstance(count, int):
        raise InputError("an entry in its list of arrays is not in the expected form")
    arrays = read_npz(folder / name, count)
    if digest(arrays) != found[1]:
        raise InputError("its content does not match its name", file=folder / name)
    return arrays


def read_npz(file: Path, count: int | None = None) -> list[np.ndarray]:
    """The arrays a0, a1, … of a file; `count`: expected number of arrays, if known."""
    file.stat()  # FileNotFoundError is left to the caller: another process may have saved meanwhile
    with readable(file, "archive of results"):
        check_npz(file)
        with np.load(file, allow_pickle=False) as npz:
            if count is not None and len(npz.files) != count:
                raise InputError(f"has {len(npz.files)} arrays, expected {count}", file=file)
            return [npz[f"a{i}"] for i in range(len(npz.files))]


def remove_others(folder: Path, keep: Sequence[dict[str, Any]]) -> None:
    """Remove the files of results that are no longer used, and leftovers of interrupted saves."""
    names = {entry["file"] for entry in keep}
    for file in (folder / FOLDER).glob("*.npz"):
        if f"{FOLDER}/{file.name}" not in names:
            file.unlink(missing_ok=True)
    if (folder / FOLDER).is_dir():
        remove_leftovers(folder / FOLDER, age=0.0)
