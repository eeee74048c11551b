"""Named arrays, in structs or not, as columns: what .mat, .npz and JSON files have in common.

A matrix gives one column for each of its columns, or one for each row where those are the longer side.
Columns of the same length share a table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.data.logs.formats.base import SHORTEST, Log, LogTable, as_numbers
from flexviz.data.measurements import Array

DEEPEST = 9  # variables, and structs in structs
MOST_SIGNALS = 200  # a matrix with more columns and more rows holds no signals
IN_MATLAB = "({})", "(:,{})", "({},:)", 1  # `log.q(:,1)`, `q(1,:)`, `signals(1)`
IN_PYTHON = "[{}]", "[:,{}]", "[{},:]", 0  # `log.q[:,0]`, `q[0,:]`, `signals[0]`


@dataclass(frozen=True)
class Flattening:
    """How entries are written, as in MATLAB or as in Python, and why some variables are no signals."""

    entry: str  # of a list: "({})"
    column: str  # of a matrix: "(:,{})"
    row: str  # "({},:)"
    first: int  # index
    unusable: dict[str, str] = field(default_factory=dict)

    def log(self, path: Path, kind: str, variables: Mapping[str, Any]) -> Log:
        """A log of all columns of numbers in the variables."""
        by_length: dict[int, dict[str, Array]] = {}
        for column, values in self.flatten("", variables, 0):
            by_length.setdefault(len(values), {})[column] = values
        if not by_length:
            found = "; ".join(f"{name}: {why}" for name, why in list(self.unusable.items())[:4]) or "nothing"
            raise InputError(f"holds no signals of {SHORTEST} samples or more ({found})", file=path)
        tables = tuple(
            LogTable("" if len(by_length) == 1 else f"{length} samples", columns)
            for length, columns in by_length.items()
        )
        return Log(path, kind, tables, self.unusable)

    def flatten(self, name: str, value: Any, depth: int) -> Iterator[tuple[str, Array]]:
        """Columns of a variable: (name, (N,) values)."""
        if isinstance(value, Mapping) and depth < DEEPEST:
            for key, inside in value.items():
                yield from self.flatten(f"{name}.{key}" if name else key, inside, depth + 1)
        elif isinstance(value, list) and depth < DEEPEST and len(value) <= MOST_SIGNALS:
            for i, inside in enumerate(value):  # a struct array or a cell
                yield from self.flatten(name + self.entry.format(i + self.first), inside, depth + 1)
        elif isinstance(value, np.ndarray) and value.dtype == object and depth < DEEPEST:
            if value.ndim == 1 and len(value) <= MOST_SIGNALS:
                yield from self.flatten(name, list(value), depth)
            else:
                self.unusable[name] = "a cell array that holds more than signals"
        elif isinstance(value, np.ndarray) and value.dtype.names:
            self.unusable[name] = "an opaque object (timetable, table, timeseries); convert it to arrays"
        elif isinstance(value, np.ndarray):
            yield from self.columns(name, value)
        else:
            self.unusable[name] = "text" if isinstance(value, str) else "a single value"

    def columns(self, name: str, array: Array) -> Iterator[tuple[str, Array]]:
        """A vector, or a matrix's columns (rows where those are the longer side)."""
        numbers = as_numbers(array)
        if numbers is None:
            self.unusable[name] = "it holds no real numbers"
        elif array.ndim == 1 or (array.ndim == 2 and 1 in array.shape):
            if array.size < SHORTEST:
                self.unusable[name] = f"{array.size} values, expected at least {SHORTEST}"
            else:
                yield name, numbers.ravel()
        elif array.ndim == 2 and max(array.shape) >= SHORTEST and min(array.shape) <= MOST_SIGNALS:
            rows = array.shape[0] >= array.shape[1]
            for i in range(min(array.shape)):
                label = (self.column if rows else self.row).format(i + self.first)
                yield name + label, np.ascontiguousarray(numbers[:, i] if rows else numbers[i])
        elif array.ndim == 3 and max(array.shape) >= SHORTEST and sorted(array.shape)[0] == 1:
            yield from self.columns(name, np.squeeze(array))  # Simulink's (1, n, N)
        else:
            self.unusable[name] = f"an array of shape {array.shape}"
