"""A log of any format once it is read: tables of columns that share their rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flexviz.base.errors import Cancelled, InputError, choose_from
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.data.measurements import Array

STAMP, LOGGED = "header.stamp", "log_time"  # endings of the two time columns of a topic
EMPTY_FIELD = "the messages hold no"  # begins the reason why a field that a driver leaves empty is no signal
PART = " part "  # in the names of parts of a column: "tau part 1 of 6"
LETTERS = "abc"  # of several files of one run, in order: columns are `a/column` in the first
SHORTEST = 32  # rows: shorter columns cannot be signals


@dataclass(frozen=True, eq=False)
class LogTable:
    """Columns recorded together: a topic, a file of rows, variables of one length in a .mat file."""

    name: str  # the topic's; "" where a log has one table only
    # name -> (N,) values as recorded, NaN where there is none; float64, or int64 where whole numbers must
    # stay exact (times)
    columns: Mapping[str, Array]
    clock: str | None = None  # the time column, where the format knows it
    units: Mapping[str, str] = field(default_factory=dict)  # name -> unit that the file states ("ns", "deg")

    @property
    def rows(self) -> int:
        """Number of rows N."""
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True, eq=False)
class Log:
    """One recording."""

    file: Path  # where it was read from
    kind: str  # "CSV", "Parquet", "MATLAB", "NumPy", "JSON", "ROS 2 bag", "ROS 1 bag" or "LeRobot episode 3"
    tables: tuple[LogTable, ...]  # its tables; a column's name occurs once in all of them
    # name -> why it is not a signal (text, too short, …)
    unusable: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # observations while reading, one sentence each
    unread: tuple[str, ...] = ()  # columns that were not asked for

    @property
    def columns(self) -> dict[str, LogTable]:
        """Name of every column -> its table."""
        return {name: table for table in self.tables for name in table.columns}

    def table_of(self, column: str, file: Path | None = None, place: str | None = None) -> LogTable:
        """The table that holds `column`; errors name `file` and `place`, where the column was asked for."""
        columns = self.columns
        if column in columns:
            return columns[column]
        if column in self.unusable:
            message = f'"{column}" of {self.file.name} cannot be used: {self.unusable[column]}'
        else:
            valid = choose_from(column, [*self.unread, *columns], limit=40)
            message = f'"{column}" is not in {self.file.name}; {valid}'
        raise InputError(message, file=file or self.file, place=place)


@dataclass(frozen=True)
class ReadOptions:
    """How a log is to be read."""

    wanted: Collection[str] | None = None  # columns that are needed; None: all. A reader may give more
    episode: int | None = None  # which one, in a dataset of episodes
    progress: ProgressCallback = ignore  # see flexviz.base.progress
    should_stop: StopCallback = never

    def wants(self, column: str) -> bool:
        """Whether a column, or an entry of it, is needed."""
        if self.wanted is None or column in self.wanted:
            return True
        return any(name.startswith((f"{column}[", f"{column}/", column + PART)) for name in self.wanted)


@dataclass(frozen=True)
class LogFormat:
    """One format of logs."""

    title: str  # its name in messages
    # a path and options -> its log; InputError where it cannot be read
    read: Callable[[Path, ReadOptions], Log]
    suffixes: tuple[str, ...] = ()  # of its files
    folder: str = ""  # a folder of this format, and the file by which it is recognised
    mark: str = ""
    episodes: Callable[[Path], list[int]] | None = None  # the numbers of the logs in a dataset of many
    named: bool = False  # read only where it is named: in a folder such files are rarely logs

    def recognises(self, path: Path) -> bool:
        """Whether a file or folder is of this format, judged by its name."""
        if path.is_dir():
            return bool(self.mark) and (path / self.mark).is_file()
        return path.suffix.lower() in self.suffixes


def check_stop(should_stop: StopCallback) -> None:
    """Cancelled, when the user asked to stop."""
    if should_stop():
        raise Cancelled("stopped by the user; nothing was written")


def check_rows(count: int, path: Path) -> None:
    """InputError for a table that is too short to hold signals."""
    if count < SHORTEST:
        raise InputError(f"{count} rows, expected at least {SHORTEST}", file=path)


def as_numbers(values: Array) -> Array | None:
    """A column as int64 or as float64 with NaN for what is not finite; None when it holds no numbers."""
    if values.dtype.kind == "i":
        return values.astype(np.int64, copy=False)
    if values.dtype.kind not in "bfu":
        return None
    numbers = values.astype(float)
    return np.where(np.isfinite(numbers), numbers, np.nan)


def joined(logs: Sequence[Log]) -> Log:
    """One log of the tables of several."""
    lettered = list(zip(LETTERS, logs, strict=False))
    return Log(
        logs[0].file.with_name(", ".join(log.file.name for log in logs)),
        logs[0].kind,
        tuple(renamed(table, letter) for letter, log in lettered for table in log.tables),
        {f"{letter}/{name}": why for letter, log in lettered for name, why in log.unusable.items()},
        tuple(f"{log.file.name}: {note}" for log in logs for note in log.notes),
        tuple(f"{letter}/{name}" for letter, log in lettered for name in log.unread),
    )


def renamed(table: LogTable, letter: str) -> LogTable:
    """A table with its file's letter before all names."""
    return LogTable(
        f"{letter}/{table.name}" if table.name else letter,
        {f"{letter}/{name}": values for name, values in table.columns.items()},
        f"{letter}/{table.clock}" if table.clock else None,
        {f"{letter}/{name}": unit for name, unit in table.units.items()},
    )
