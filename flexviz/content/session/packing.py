"""Results of a session as JSON and arrays, by the adapter of their classes; nothing is executed.

The arrays of a result are one file, named by its content and written once. An array is {"#": its number}, a
number that is not finite {"~": its name}; results that several steps share are written once and referred to
as {"@": number}.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from flexviz.base.errors import InputError
from flexviz.base.fields import named
from flexviz.base.files import remove_leftovers, write_whole
from flexviz.base.limits import LARGEST_UNPACKED, check_npz
from flexviz.base.schemas import input_error
from flexviz.data.measurements import readable

FOLDER = "results"
NOT_FINITE = ("nan", "inf", "-inf")
_FILE = re.compile(rf"{FOLDER}/([0-9a-f]{{32}})\.npz")


@cache
def adapter(kind: Any) -> TypeAdapter[Any]:
    """What writes and checks a class."""
    return TypeAdapter(kind)


class Packer:
    """Objects as JSON; the context of the adapter, which collects the numbered arrays and shared values."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.arrays: list[np.ndarray] = []
        self.shared: list[Any] = []
        self._numbers: dict[int, int] = {}
        self._depth = 0  # of nested shared values
        self._bounds: list[int] = [0]  # array numbers at which outermost shared values begin and end

    def pack(self, value: Any) -> Any:
        """The value as JSON."""
        return adapter(type(value)).dump_python(value, mode="json", context=self)

    def parts(self) -> list[list[np.ndarray]]:
        """All arrays in order, split into one list per result."""
        bounds = [*self._bounds, len(self.arrays)]
        return [self.arrays[first:last] for first, last in pairwise(bounds) if last > first]

    def keep(self, array: np.ndarray) -> dict[str, int]:
        """What stands for an array."""
        self.arrays.append(array)
        return {"#": len(self.arrays) - 1}

    def once(self, value: Any, pack: Callable[[Any], Any]) -> dict[str, int]:
        """What stands for a shared value, which is packed when it occurs first."""
        if id(value) not in self._numbers:
            begin = len(self.arrays)
            self._depth += 1
            packed = pack(value)
            self._depth -= 1
            if not self._depth:
                self._bounds += [begin, len(self.arrays)]
            self._numbers[id(value)] = len(self.shared)
            self.shared.append(packed)
        return {"@": self._numbers[id(value)]}

    def in_set(self, path: Path) -> str:
        """A path; "." for the set's own, as a session may be moved."""
        return "." if path == self._folder else str(path)


class Unpacker:
    """JSON as objects; the context of the adapter, which gives it arrays and shared values.

    InputError for anything that `Packer` does not write.
    """

    def __init__(self, folder: Path, arrays: Sequence[np.ndarray], shared: Sequence[Any]) -> None:
        self._folder, self._arrays, self._packed = folder, arrays, shared
        self.shared: dict[int, Any] = {}
        self._below = len(shared)  # a shared value refers to earlier ones only

    def unpack(self, kind: Any, value: Any) -> Any:
        """The object of a class that this JSON describes."""
        try:
            return adapter(kind).validate_json(json.dumps(value), strict=True, context=self)
        except ValidationError as error:
            raise input_error(error, value) from None

    def array(self, value: dict[str, Any]) -> np.ndarray:
        """The array that an entry stands for."""
        return self._arrays[_index(value.get("#"), len(self._arrays))]

    def shared_value(self, kind: Any, value: Any) -> Any:
        """The shared value that an entry stands for."""
        number = _index(value.get("@") if isinstance(value, dict) else value, self._below)
        if number not in self.shared:
            below, self._below = self._below, number
            self.shared[number] = self.unpack(kind, self._packed[number])
            self._below = below
        if not isinstance(self.shared[number], kind):
            raise InputError(f"reference {number} is not to a {kind.__name__}")
        return self.shared[number]

    def from_set(self, path: Path) -> Path:
        """The path that `Packer.in_set` wrote."""
        return self._folder if path == Path(".") else path


def named_numbers(value: Any) -> Any:
    """JSON in which a number that is not finite is {"~": its name}."""
    if isinstance(value, dict):
        return {key: named_numbers(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [named_numbers(item) for item in value]
    return named(value) if isinstance(value, float) else value


def numbers(value: Any) -> Any:
    """What `named_numbers` was made of."""
    if isinstance(value, list):
        return [numbers(item) for item in value]
    if not isinstance(value, dict):
        return value
    if value.keys() == {"~"} and value["~"] in NOT_FINITE:
        return float(value["~"])
    return {key: numbers(item) for key, item in value.items()}


def _index(number: Any, count: int) -> int:
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < count:
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
