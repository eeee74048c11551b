"""MATLAB .mat files (up to v7.2): variables and the fields of structs as columns.

A matrix gives one column for each of its columns, written as MATLAB does: `log.q(:,2)`; a matrix with one
signal per row gives `log.q(2,:)`. Columns of the same length share a table.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from flexviz.errors import InputError
from flexviz.importing.formats.base import SHORTEST, Log, LogFormat, LogTable, ReadOptions, as_numbers
from flexviz.measurements import Array, readable

HDF5 = b"\x89HDF\r\n\x1a\n"
DEEPEST = 9  # variables, and structs in structs
MOST_SIGNALS = 200  # a matrix with more columns and more rows holds no signals


def read_mat(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers of a .mat file."""
    with path.open("rb") as stream:
        head = stream.read(1024)
    if HDF5 in head or head.startswith(b"MATLAB 7.3"):
        raise InputError(
            "a .mat file of version 7.3 is HDF5, expected an older one; in MATLAB load it and save it again: "
            "s = load('FILE.mat'); save('FILE7.mat', '-struct', 's', '-v7'), or write the signals as a table "
            "with parquetwrite or writetable",
            file=path,
        )
    with readable(path, ".mat file"):
        content = loadmat(path, simplify_cells=True)
    by_length: dict[int, dict[str, Array]] = {}
    unusable: dict[str, str] = {}
    variables = {name: value for name, value in content.items() if not name.startswith("__")}
    for column, values in flatten("", variables, unusable, 0):
        by_length.setdefault(len(values), {})[column] = values
    if "None" in content or any("opaque" in why for why in unusable.values()):
        unusable["(objects)"] = "timetable, table and timeseries objects cannot be read outside MATLAB"
    if not by_length:
        found = "; ".join(f"{name}: {why}" for name, why in list(unusable.items())[:4])
        raise InputError(f"holds no signals of {SHORTEST} samples or more ({found or 'nothing'})", file=path)
    tables = tuple(
        LogTable("" if len(by_length) == 1 else f"{length} samples", columns)
        for length, columns in by_length.items()
    )
    return Log(path, "MATLAB", tables, unusable)


def flatten(name: str, value: Any, unusable: dict[str, str], depth: int) -> Iterator[tuple[str, Array]]:
    """Columns of a variable: (name, (N,) values)."""
    if isinstance(value, dict) and depth < DEEPEST:
        for key, inside in value.items():
            yield from flatten(f"{name}.{key}" if name else key, inside, unusable, depth + 1)
    elif isinstance(value, list) and depth < DEEPEST and len(value) <= MOST_SIGNALS:
        for i, inside in enumerate(value):  # a struct array or a cell
            yield from flatten(f"{name}({i + 1})", inside, unusable, depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype == object and depth < DEEPEST:
        if value.ndim == 1 and len(value) <= MOST_SIGNALS:
            yield from flatten(name, list(value), unusable, depth)
        else:
            unusable[name] = "a cell array that holds more than signals"
    elif isinstance(value, np.ndarray) and value.dtype.names:
        unusable[name] = "an opaque object (timetable, table, timeseries); convert it to arrays in MATLAB"
    elif isinstance(value, np.ndarray):
        yield from columns(name, value, unusable)
    else:
        unusable[name] = "text" if isinstance(value, str) else "a single value"


def columns(name: str, array: Array, unusable: dict[str, str]) -> Iterator[tuple[str, Array]]:
    """A vector, or a matrix's columns (rows where those are the longer side)."""
    numbers = as_numbers(array)
    if numbers is None:
        unusable[name] = "it holds no real numbers"
    elif array.ndim == 1 or 1 in array.shape:
        if array.size < SHORTEST:
            unusable[name] = f"{array.size} values, expected at least {SHORTEST}"
        else:
            yield name, numbers.ravel()
    elif array.ndim == 2 and max(array.shape) >= SHORTEST and min(array.shape) <= MOST_SIGNALS:
        rows = array.shape[0] >= array.shape[1]
        for i in range(min(array.shape)):
            label = f"{name}(:,{i + 1})" if rows else f"{name}({i + 1},:)"
            yield label, np.ascontiguousarray(numbers[:, i] if rows else numbers[i])
    elif array.ndim == 3 and max(array.shape) >= SHORTEST and sorted(array.shape)[0] == 1:
        yield from columns(name, np.squeeze(array), unusable)  # Simulink's (1, n, N)
    else:
        unusable[name] = f"an array of shape {array.shape}"


MATLAB = LogFormat(".mat", read_mat, suffixes=(".mat",))
