"""Logs as a form shows them: which files can be read, and a preview of every column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never, part
from flexviz.content.charts import thin
from flexviz.data.importing.draft import Draft
from flexviz.data.logs import TIME, ReadOptions, check_stop, find_logs, open_run
from flexviz.data.measurements import Array

PREVIEWED = 160  # values of a column that are drawn


@dataclass(frozen=True, eq=False)
class ColumnPreview:
    """A column of a log, thinned with its extremes kept.

    Attributes:
        values: (M,) in the log's own unit, M at most 160.
        low, high: smallest and largest value.
    """

    values: Array
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class LogPreview:
    """The first run of a draft.

    Attributes:
        rows: of its longest table.
        columns: name -> preview, in the log's order, of all that hold numbers.
        times: the columns that can be a time, which increase.
    """

    rows: int
    columns: Mapping[str, ColumnPreview]
    times: tuple[str, ...]


def readable(
    paths: Sequence[Path], *, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> tuple[list[Path], dict[str, str]]:
    """The files that can be read as logs, and name -> why not of the others."""
    good: list[Path] = []
    refused: dict[str, str] = {}
    for i, path in enumerate(paths):
        options = ReadOptions(None, None, part(progress, i / len(paths), (i + 1) / len(paths)), should_stop)
        try:
            for source in find_logs([path]):
                open_run(source, options)
            good.append(path)
        except InputError as error:
            refused[path.name] = str(error).replace(f"{path.parent}/", "").removeprefix(f"{path.name}: ")
        check_stop(should_stop)
    return good, refused


def preview(draft: Draft, *, should_stop: StopCallback = never) -> LogPreview:
    """Preview the first run of a draft."""
    log = open_run(draft.sources[0], ReadOptions(None, None, ignore, should_stop))
    columns, times = dict[str, ColumnPreview](), list[str]()
    for table in log.tables:
        for name, values in table.columns.items():
            known = np.flatnonzero(np.isfinite(values))
            if not len(known):
                continue
            drawn = thin(known.astype(float), [values[known]], PREVIEWED)[1][0]
            columns[name] = ColumnPreview(drawn, float(values[known].min()), float(values[known].max()))
            steps = np.diff(values[known])
            if name == table.clock or table.units.get(name) in TIME or (len(steps) and (steps >= 0).all()):
                times.append(name)
    return LogPreview(max(table.rows for table in log.tables), columns, tuple(times))
