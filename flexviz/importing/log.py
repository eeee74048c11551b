"""What a log is once it is read, whatever its format: tables of columns that share their rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flexviz.errors import Cancelled, InputError, choose_from
from flexviz.measurements import Array
from flexviz.progress import ProgressCallback, StopCallback, ignore, never

STAMP, LOGGED = "header.stamp", "log_time"  # endings of the two time columns of a topic
EMPTY = "the messages hold no"  # how the reason begins why a field that a driver leaves empty is no signal
SHORTEST = 32  # rows: shorter columns cannot be signals
Stop = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Table:
    """Columns that were recorded together: a topic, a file of rows, variables of one length in a .mat file.

    Attributes:
        name: the topic's name; "" where a log has one table only.
        columns: name -> (N,) values as recorded, float64, or int64 where whole numbers must stay exact
            (times);
            NaN where there is no value.
        clock: the column that says when, where the format knows it.
        units: name -> unit as the file states it ("ns", "deg"), where it does.
    """

    name: str
    columns: Mapping[str, Array]
    clock: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of rows N."""
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True, eq=False)
class Log:
    """One recording.

    Attributes:
        file: what it was read from.
        kind: "CSV", "Parquet", "MATLAB", "ROS 2 bag", "ROS 1 bag" or "LeRobot episode 3".
        tables: what it holds; a column's name occurs once in all of them.
        unusable: name -> why it is not a signal (text, too short, …).
        unread: names of columns that were not asked for.
        notes: what was noticed while reading, one sentence each.
    """

    file: Path
    kind: str
    tables: tuple[Table, ...]
    unusable: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()

    @property
    def columns(self) -> dict[str, Table]:
        """Name of every column -> its table."""
        return {name: table for table in self.tables for name in table.columns}

    def table_of(self, column: str, file: Path | None = None, place: str | None = None) -> Table:
        """The table that holds `column`; errors name `file` and `place`, where the column was asked for."""
        columns = self.columns
        if column in columns:
            return columns[column]
        if column in self.unusable:
            raise InputError(
                f'"{column}" of {self.file.name} cannot be used: {self.unusable[column]}',
                file=file or self.file,
                place=place,
            )
        raise InputError(
            f'"{column}" is not in {self.file.name}; '
            + choose_from(column, [*self.unread, *columns], limit=40),
            file=file or self.file,
            place=place,
        )


@dataclass(frozen=True)
class Reading:
    """How a log is to be read.

    Attributes:
        wanted: columns that are needed; None: all. A reader may give more.
        episode: which one, in a dataset of episodes.
        progress, should_stop: as everywhere.
    """

    wanted: Collection[str] | None = None
    episode: int | None = None
    progress: ProgressCallback = ignore
    should_stop: StopCallback = never

    def wants(self, column: str) -> bool:
        """Whether a column is needed."""
        return self.wanted is None or column in self.wanted

    def check_stop(self) -> None:
        """Cancelled, when the user asked to stop."""
        if self.should_stop():
            raise Cancelled("stopped by the user; nothing was written")


def as_numbers(values: Array) -> Array | None:
    """A column as float64 with NaN for what is not finite, int64 as it is; None when it holds no numbers."""
    if values.dtype.kind == "i":
        return values.astype(np.int64, copy=False)
    if values.dtype.kind not in "bfu":
        return None
    numbers = values.astype(float)
    return np.where(np.isfinite(numbers), numbers, np.nan)
