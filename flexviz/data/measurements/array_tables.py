"""Runs given as arrays, DataFrames or Datasets, as the tables of a set's groups."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.data.measurements.data import OPTIONAL_SIGNALS, Array, FileHash
from flexviz.data.measurements.tables import require_finite

SIGNALS = ("theta", "tau", *OPTIONAL_SIGNALS)
EXPECTED = "expected time, and theta and tau of every joint"


@dataclass(frozen=True, eq=False)
class ArrayTable:
    """A table in memory: name of each column -> (N,)."""

    file: Path
    columns: dict[str, Array]

    @property
    def names(self) -> list[str]:
        return list(self.columns)

    def read(self, names: Sequence[str]) -> Array:
        for name in names:
            require_finite(self.columns[name], name, self.file)
        return np.array([self.columns[name] for name in names]).T

    @property
    def hash(self) -> FileHash:
        """Of the names and numbers of its columns, in the place of a file's."""
        content = b"".join(name.encode() + column.tobytes() for name, column in self.columns.items())
        return FileHash(str(self.file), hashlib.sha256(content).hexdigest(), len(content))


def array_tables(data: Any, joints: Sequence[str], place: Path) -> dict[str, ArrayTable]:
    """Name of each group -> its table, from one run or from a mapping of runs.

    Raises:
        InputError: for what cannot be a run; `place` is what errors call `data`.
    """
    several = isinstance(data, Mapping) and "time" not in data and all(map(is_run, data.values()))
    runs = data if several else {"run": data}
    if not runs:
        raise InputError("there is no run, expected at least one", file=place)
    return {str(name): array_table(run, joints, Path(str(name))) for name, run in runs.items()}


def is_run(given: Any) -> bool:
    """Whether something has named columns."""
    return isinstance(given, Mapping) or (hasattr(given, "keys") and hasattr(given, "__getitem__"))


def array_table(run: Any, joints: Sequence[str], file: Path) -> ArrayTable:
    """The columns of one run, each (N,) float64."""
    if not is_run(run):
        message = f"is of type {type(run).__name__}, expected a mapping, a DataFrame or a Dataset: {EXPECTED}"
        raise InputError(message, file=file)
    names = [str(key) for key in run.keys()]  # noqa: SIM118  # of a Dataset, without its coordinates
    time = numbers(seconds(time_of(run, names, file)), "time", file)
    count = time.size
    columns = {"time": shaped(time, (count,), "time", file)}
    one_each = {f"{kind}_{joint}" for kind in SIGNALS for joint in joints}  # tau_joint may be one of them
    for name in names:
        if name in SIGNALS and name not in one_each:
            both = matrix(run[name], name, joints, count, file)
            columns |= {f"{name}_{joint}": both[:, j] for j, joint in enumerate(joints)}
        elif name in one_each:
            columns[name] = shaped(numbers(run[name], name, file), (count,), name, file)
        elif name != "time":
            columns[name] = np.zeros(0)  # never read, only named
    return ArrayTable(file, columns)


def time_of(run: Any, names: Iterable[str], file: Path) -> Any:
    """The run's time: a column or coordinate of that name, or an index of that name or of dates."""
    if "time" in run:
        return run["time"]
    index = getattr(run, "index", None)
    if getattr(index, "name", None) == "time" or getattr(getattr(index, "dtype", None), "kind", None) in (
        "m",
        "M",
    ):
        return index
    raise InputError(f"there is no time, {EXPECTED}; found {', '.join(names) or 'nothing'}", file=file)


def seconds(time: Any) -> Any:
    """Dates and durations as seconds after the first one; numbers as they are."""
    values = np.asarray(time)
    if values.dtype.kind not in "mM" or not len(values):
        return time
    return (values - values[0]) / np.timedelta64(1, "s")


def matrix(values: Any, name: str, joints: Sequence[str], count: int, file: Path) -> Array:
    """A signal of all joints, (N, n) in their order; labelled columns are put into it."""
    dims = getattr(values, "dims", ())
    if "time" in dims:  # of a DataArray
        values = values.transpose("time", ...)
        dims = values.dims
    labels = getattr(values, "columns", None)
    if labels is None and len(dims) == 2 and dims[1] in getattr(values, "coords", {}):
        labels = values.coords[dims[1]].values
    found = numbers(values, name, file)
    if found.ndim == 1 and len(joints) == 1:
        found = found[:, None]
    found = shaped(found, (count, len(joints)), name, file)
    texts = [label for label in (() if labels is None else labels) if isinstance(label, str)]
    if not texts:
        return found
    plain = [text.removeprefix(f"{name}_") if text not in joints else text for text in texts]
    if sorted(plain) != sorted(joints):
        message = f"has columns {', '.join(texts)}, expected {', '.join(joints)}"
        raise InputError(message, file=file, place=name)
    return found[:, [plain.index(joint) for joint in joints]]


def shaped(found: Array, shape: tuple[int, ...], name: str, file: Path) -> Array:
    """`found`; InputError if it has another shape."""
    if found.shape != shape:
        per = "one row per time, one column per joint" if len(shape) == 2 else "one value per time"
        message = f"has the shape {found.shape}, expected {shape}: {per}"
        raise InputError(message, file=file, place=name)
    return found


def numbers(values: Any, name: str, file: Path) -> Array:
    """A copy as float64, masked values as NaN; InputError for what are no numbers."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(float), np.nan)
    try:
        found = np.asarray(values)
        if found.dtype.kind not in "fiuO":
            raise TypeError(f"found {found.dtype}")
        return np.array(found, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"holds no numbers ({error})", file=file, place=name) from None
