"""When a column's values were recorded: its time column, made strictly increasing seconds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.importing.log import LOGGED, SHORTEST, STAMP, Log, Table
from flexviz.importing.mapping import TimeColumn
from flexviz.importing.units import TIME, unit_in
from flexviz.measurements import Array

TOO_MANY_REPEATED = 0.2  # share of repeated instants from which the clock is too coarse to be used
OUT_OF_ORDER = 1.0  # [s] messages that come late by less are put into order
LIKELY = ("time", "timestamp", "t", "stamp", "clock", "sec", "seconds", "ts", "zeit", "tout")


@dataclass(frozen=True, eq=False)
class Clock:
    """When the rows of a table were recorded.

    Attributes:
        name: its column; "" where the rows are equally spaced.
        table: the table's name.
        raw: (N,) as recorded; int64 stays exact.
        unit: [s] one step of `raw`.
        shift: [s] that the mapping adds.
    """

    name: str
    table: str
    raw: Array
    unit: float
    shift: float = 0.0

    @property
    def key(self) -> str:
        """What `time.shift` calls it: the topic, or the time column."""
        return self.table or self.name

    def seconds(self, origin: Clock) -> Array:
        """(N,) seconds after the first instant of `origin`."""
        if self.unit == origin.unit and self.raw.dtype.kind == "i":  # exact in whole numbers
            return (self.raw - origin.raw[0]).astype(float) * self.unit + self.shift
        return self.raw * self.unit - float(origin.raw[0]) * origin.unit + self.shift


def clock_of(log: Log, table: Table, asked: str | None, time: TimeColumn, file: Path, place: str) -> Clock:
    """The clock of a table's columns; `asked` is the time column that the mapping names for this signal.

    Errors name `file` and `place`, where the mapping says what the column is.
    """
    name = asked or own_clock(table, time) or time.column
    if name is None and time.step is not None:
        return Clock("", table.name, np.arange(table.rows), time.step, time.shift.get(table.name, 0.0))
    if name is None:
        named = [name for name in log.unread if called_time(name)] or likely_clocks(table)
        likely = ", ".join(f'"{x}"' for x in named) or "none; or step = 0.001, seconds a row"
        raise InputError(
            f"which column of {log.file.name} says when? likely: {likely}", file=file, place="time.column"
        )
    where = f"{place}.time" if asked else "time.column"
    if log.table_of(name, file, where) is not table:
        likely = ", ".join(f'"{x}"' for x in likely_clocks(table)) or "none"
        raise InputError(
            f'"{name}" has {len(log.columns[name].columns[name])} rows in {log.file.name} and the signal has '
            f"{table.rows}: time = … is needed for this signal; likely: {likely}",
            file=file,
            place=place,
        )
    stated = table.units.get(name)
    known = stated in TIME and (
        name == table.clock or stated == "ns"
    )  # the format or the column's type says it
    unit = stated if known and stated else time.unit
    size = TIME[unit] if isinstance(unit, str) else float(unit)
    clock = Clock(name, table.name, table.columns[name], size)
    return Clock(name, table.name, clock.raw, size, time.shift.get(clock.key, 0.0))


def own_clock(table: Table, time: TimeColumn) -> str | None:
    """The time column that the format itself names."""
    if table.clock is not None and time.clock == "log" and table.clock.endswith(STAMP):
        return table.clock.removesuffix(STAMP) + LOGGED
    return table.clock


def likely_clocks(table: Table) -> list[str]:
    """Columns that can be the time: they increase, and are called so (those first) or nothing else is."""
    rising = [name for name, values in table.columns.items() if increases(values)]
    called = [name for name in rising if called_time(name) or table.units.get(name) in TIME]
    return called or rising[:1]


def increases(values: Array) -> bool:
    """Whether a column goes up from row to row, but for a few repeated or missing values."""
    known = values if values.dtype.kind == "i" else values[np.isfinite(values)]
    if len(known) < SHORTEST or len(known) < 0.5 * len(values):
        return False
    steps = np.diff(known)
    return bool((steps >= 0).all() and np.count_nonzero(steps) > (1 - TOO_MANY_REPEATED) * len(steps))


def called_time(name: str) -> bool:
    """Whether a column's name says that it is a time."""
    from flexviz.importing.names import words

    return bool(set(words(name)) & set(LIKELY)) or unit_in(name) in TIME


def rows_in_order(time: Array, what: str, from_bag: bool, file: Path) -> tuple[NDArray[np.intp], list[str]]:
    """Rows (M,) in which `time` (N,) strictly increases, and what had to be done for it.

    Repeated instants keep the first row. Messages out of order are sorted; rows out of order are an error.
    """
    notes: list[str] = []
    rows = np.flatnonzero(np.isfinite(time))
    known = time[rows]
    back = np.flatnonzero(np.diff(known) < 0)
    if len(back):
        i = int(back[0])
        fall = float(np.max(known[back] - known[back + 1]))
        if not from_bag or fall > OUT_OF_ORDER:
            wanted = "one run a log would be right" + ("" if from_bag else ": are several runs in this file?")
            raise InputError(
                f"time goes back from {known[i]:.6g} s to {known[i + 1]:.6g} s, {wanted}",
                file=file,
                place=f"row {rows[i + 1] + 1}, {what}",
            )
        rows = rows[np.argsort(known, kind="stable")]
        notes.append(
            f"{what}: {len(back)} messages came late, by up to {fall:.3g} s, and were put into order"
        )
    fresh = np.concatenate([[True], np.diff(time[rows]) > 0])
    if not fresh.all():
        lost = int(np.count_nonzero(~fresh))
        if lost > TOO_MANY_REPEATED * len(fresh):
            raise InputError(
                f"{lost} of {len(fresh)} instants repeat the one before, a finer clock would be right",
                file=file,
                place=what,
            )
        rows = rows[fresh]
        notes.append(f"{what}: {lost} rows that repeat the instant before were dropped")
    return rows, notes
