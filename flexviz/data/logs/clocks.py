"""Time columns: which one belongs to a signal, its unit, and its rows in strictly increasing order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz.base.arrays import Indices
from flexviz.base.errors import InputError
from flexviz.data.logs.column_names import TIME, size_of, unit_in, words
from flexviz.data.logs.formats.base import LOGGED, SHORTEST, STAMP, Log, LogTable
from flexviz.data.logs.mapping import TimeColumn
from flexviz.data.logs.proposals import Proposal
from flexviz.data.measurements import Array

TIME_WORDS = {"time", "timestamp", "t", "stamp", "clock", "sec", "seconds", "ts", "zeit", "tout"}
USUAL_STEPS = (2e-4, 5e-2)  # [s] that robots are recorded with
POSSIBLE_STEPS = (2e-5, 0.2)  # [s]
REPEATED = 0.2  # share of repeated instants above which a clock is too coarse to be used
LATE = 1.0  # [s] messages that come late by less are sorted; later ones are another run


class CoarseClock(InputError):
    """A clock that most rows share an instant of.

    Attributes:
        proposal: the key that explains it; None: nothing does.
    """

    proposal: Proposal | None = None


@dataclass(frozen=True, eq=False)
class LogClock:
    """When the rows of a table were recorded."""

    name: str  # its column; "" where the rows are equally spaced
    table: str  # the table's name
    raw: Array  # (N,) as recorded; int64 stays exact
    unit: float  # [s] one step of `raw`
    shift: float  # [s] that the mapping adds
    logged: bool = False  # whether the time of recording would do

    @property
    def key(self) -> str:
        """Its key in `time.shift`: the topic, or the time column."""
        return self.table or self.name

    def seconds(self, origin: LogClock) -> Array:
        """(N,) seconds after the first instant of `origin`."""
        if self.unit == origin.unit and self.raw.dtype.kind == "i":  # exact in whole numbers
            return (self.raw - origin.raw[0]).astype(float) * self.unit + self.shift
        return self.raw * self.unit - float(origin.raw[0]) * origin.unit + self.shift


def clock_of(
    log: Log, table: LogTable, asked: str | None, time: TimeColumn, file: Path, place: str
) -> LogClock:
    """The clock of a table's columns; `asked` is the time column that the mapping names for this signal.

    Errors name `file` and `place`, the signal's entry in the mapping.
    """
    own = table.clock  # that the format itself names
    if own is not None and time.clock == "log" and own.endswith(STAMP):
        own = own.removesuffix(STAMP) + LOGGED
    name = asked or own or time.column
    if name is None and time.step is not None:
        return LogClock("", table.name, np.arange(table.rows), time.step, time.shift.get(table.name, 0.0))
    if name is None:
        named = [name for name in log.unread if called_time(name)] or likely_clocks(table)
        likely = ", ".join(f'"{x}"' for x in named) or "none; or step = 0.001, seconds per row"
        message = f"which column of {log.file.name} is the time? likely: {likely}"
        raise InputError(message, file=file, place="time.column")
    holder = log.table_of(name, file, f"{place}.time" if asked else "time.column")
    if holder is not table:
        likely = ", ".join(f'"{x}"' for x in likely_clocks(table)) or "none"
        message = (
            f'"{name}" has {holder.rows} rows in {log.file.name} and the signal has {table.rows}, expected '
            f"time = … for this signal; likely: {likely}"
        )
        raise InputError(message, file=file, place=place)
    stated = table.units.get(name)  # "ns" is stated by the column's type
    unit = stated if stated in TIME and (name == table.clock or stated == "ns") else time.unit
    size = size_of(unit, TIME)
    received = table.columns.get(name.removesuffix(STAMP) + LOGGED) if name.endswith(STAMP) else None
    logged = received is not None and increases(received)
    shift = time.shift.get(table.name or name, 0.0)
    return LogClock(name, table.name, table.columns[name], size, shift, logged)


def likely_clocks(table: LogTable) -> list[str]:
    """Increasing columns with the name or unit of a time, else the first increasing one."""
    rising = [name for name, values in table.columns.items() if increases(values)]
    called = [name for name in rising if called_time(name) or table.units.get(name) in TIME]
    return called or rising[:1]


def increases(values: Array) -> bool:
    """Whether a column increases from row to row, but for a few repeated or missing values."""
    known = finite(values)
    if len(known) < SHORTEST or len(known) < 0.5 * len(values):
        return False
    steps = np.diff(known)
    return bool((steps >= 0).all() and np.count_nonzero(steps) > (1 - REPEATED) * len(steps))


def coarse_clock(table: LogTable) -> tuple[dict[str, float], str] | None:
    """The key for even rows whose time is coarser than they are spaced, and why; None without such ones."""
    for name, values in table.columns.items():
        if called_time(name) and not increases(values) and len(finite(values)) == len(values):
            size = TIME.get(table.units.get(name) or unit_in(name) or "s", 1.0)
            if (step := even_step(values * size)) is not None:
                unit = table.units.get(name) or unit_in(name) or "s"
                stated = {"column": name} | ({"unit": unit} if unit in TIME and unit != "s" else {})
                return {
                    **stated,
                    "step": step,
                }, f'seconds per row: "{name}" is coarser, and even as far as it shows'
    return None


def called_time(name: str) -> bool:
    return bool(TIME_WORDS & set(words(name))) or unit_in(name) in TIME


def rows_in_order(
    time: Array, what: str, from_bag: bool, file: Path, step: float | None = None, logged: bool = False
) -> tuple[Indices, Array, list[str]]:
    """Rows (M,) in which `time` (N,) strictly increases, their times (M,), and notes on what was done.

    Repeated instants keep the first row. Messages out of order are sorted; rows out of order are an error.
    Where most instants repeat, rows are spaced by `step` [s], if that is given and they show nothing else.

    Raises:
        CoarseClock: most instants repeat; with `step` that explains it, or the time of recording if `logged`.
    """
    notes: list[str] = []
    rows = np.flatnonzero(np.isfinite(time))
    known = time[rows]
    back = np.flatnonzero(np.diff(known) < 0)
    if len(back):
        i = int(back[0])
        fall = float(np.max(known[back] - known[back + 1]))
        if not from_bag or fall > LATE:
            hint = "" if from_bag else ": are several runs in this file?"
            message = (
                f"time goes back from {known[i]:.6g} s to {known[i + 1]:.6g} s, expected one run per log"
            )
            raise InputError(message + hint, file=file, place=f"row {rows[i + 1] + 1}, {what}")
        rows = rows[np.argsort(known, kind="stable")]
        notes.append(f"{what}: {len(back)} messages came late, by up to {fall:.3g} s, and were sorted")
    fresh = np.concatenate([[True], np.diff(time[rows]) > 0])
    lost = int(np.count_nonzero(~fresh))
    if lost > REPEATED * len(fresh):
        coarse = time[rows]
        if step is not None and is_even(coarse, step):
            return rows, coarse[0] + step * np.arange(len(rows)), notes
        raise coarse_error(coarse, what, file, step, logged)
    if lost:
        rows = rows[fresh]
        notes.append(f"{what}: {lost} rows that repeat the instant before were dropped")
    return rows, time[rows], notes


def coarse_error(time: Array, what: str, file: Path, stated: float | None, logged: bool) -> CoarseClock:
    """The error for a clock that is coarser than its rows (N,), with the key that explains them."""
    repeated = np.count_nonzero(np.diff(time) <= 0)
    message = f"{repeated} of {len(time)} instants repeat the one before, expected a finer clock"
    found = even_step(time)
    proposal = None
    if stated is not None and found != stated:
        message += f", or rows that are spaced by the stated step = {stated:.9g}"
    if found is not None and found != stated:
        proposal = Proposal(("time",), "step", found)
        message += (
            f"; the rows are evenly spaced as far as this clock shows: state step = {found:.9g} in [time]"
        )
    elif logged:
        proposal = Proposal(("time",), "clock", "log")
        message += ': clock = "log" in [time] takes the instants at which messages were received'
    error = CoarseClock(message, file=file, place=what)
    error.proposal = proposal
    return error


def is_even(time: Array, step: float) -> bool:
    """Whether rows (N,) are spaced by `step` [s] as far as a coarser clock shows."""
    steps = np.diff(time)
    return bool(np.ptp(time - step * np.arange(len(time))) <= band(float(np.min(steps[steps > 0])), time))


def band(resolution: float, time: Array) -> float:
    """How far even rows may be from a straight line by a clock of this resolution [s]."""
    return resolution + 8 * float(np.spacing(np.max(np.abs(time))))


def even_step(time: Array) -> float | None:
    """The step [s] of evenly spaced rows (N,) by a clock that is coarser; None where they are not even.

    Rounded to its resolution r, an even clock stays within a band of the width r about a straight line. The
    step is the shortest decimal number with which it does.
    """
    steps = np.diff(time)
    rises = steps[steps > 0]
    if len(time) < SHORTEST or not len(rises) or np.any(steps < 0):
        return None
    resolution, rows = float(np.min(rises)), np.arange(len(time))
    most = band(resolution, time)
    middle = float(time[-1] - time[0]) / (len(time) - 1)
    error = resolution / (len(time) - 1)
    unit = 10.0 ** np.ceil(np.log10(middle))
    while unit > 0.01 * error:
        unit /= 10
        for count in range(max(1, int(np.ceil((middle - error) / unit))), int((middle + error) / unit) + 1):
            if np.ptp(time - count * unit * rows) <= most:
                return float(f"{count * unit:.12g}")
    return None


def guess_clocks(log: Log, used: Sequence[str]) -> dict[str, str] | None:
    """Column -> its likely time column, where the format names none; None where no column looks like one."""
    every = log.columns
    chosen: dict[str, str] = {}
    for column in (column for column in used if every[column].clock is None):
        likely, said = likely_clocks(every[column]), set(words(column))
        if not likely:
            return None
        # the one that shares most words with the column's name: motor.t for motor.q
        chosen[column] = max(likely, key=lambda time: (len(said & set(words(time))), -likely.index(time)))
    return chosen


def guess_unit(table: LogTable, name: str) -> tuple[str, str]:
    """Unit of a time column, and why."""
    step = float(np.median(np.diff(finite(table.columns[name]))))
    stated = table.units.get(name) or unit_in(name)
    if stated in TIME:
        return str(stated), f"step {step * TIME[str(stated)]:.4g} s; the unit is stated"
    for bounds in (USUAL_STEPS, POSSIBLE_STEPS):
        for unit, size in TIME.items():
            if bounds[0] <= step * size <= bounds[1]:
                return unit, f"step {step * size:.4g} s, if the unit is right"
    return "s", f"step {step:.4g}: is the unit s?"


def finite(values: Array) -> Array:
    """The finite values."""
    return values if values.dtype.kind == "i" else values[np.isfinite(values)]
