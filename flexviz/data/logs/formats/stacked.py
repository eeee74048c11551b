"""Columns that hold the values of several joints, one joint after the other or alternating: taken apart.

They are recognised by a clock with fewer instants: in another table, or in their own with every instant
repeated once per joint. The parts of `tau` are called `tau part 1 of 6` and so on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flexviz.data.logs.formats.base import PART, SHORTEST, Log, LogTable
from flexviz.data.measurements import Array

MOST_PARTS = 32  # joints


def unstacked(log: Log) -> Log:
    """The log with stacked columns taken apart, and notes on them."""
    tables: dict[str, LogTable] = {}
    notes: list[str] = []
    clocks = {t.rows: t for t in log.tables if any(map(rises, t.columns.values()))}
    for table in log.tables:
        short = next((rows for rows in clocks if is_multiple(table, rows)), None)
        repeated = repeated_instants(table)
        if short is not None and not any(map(rises, table.columns.values())):
            host, count = tables.get(clocks[short].name, clocks[short]), table.rows // short
            taken = parts(table.columns, count)
        elif repeated is not None:
            time, count = repeated
            host = replace(table, columns={time: table.columns[time][::count]})
            taken = parts({name: x for name, x in table.columns.items() if name != time}, count)
        else:
            tables.setdefault(table.name, table)
            continue
        stated = {
            part: table.units[name] for name in table.units for part in taken if part.startswith(name + PART)
        }
        tables[host.name] = replace(host, columns={**host.columns, **taken}, units={**host.units, **stated})
        names = ", ".join(
            f'"{name}"' for name in table.columns if any(p.startswith(name + PART) for p in taken)
        )
        notes.append(f"{names}: the values of {count} signals in one column were taken apart")
    return replace(log, tables=tuple(tables.values()), notes=(*log.notes, *notes)) if notes else log


def is_multiple(table: LogTable, rows: int) -> bool:
    """Whether a table has the values of several signals for each of `rows` instants."""
    return rows >= SHORTEST and table.rows % rows == 0 and 2 <= table.rows // rows <= MOST_PARTS


def rises(values: Array) -> bool:
    """Whether values increase from row to row, as those of a clock."""
    return len(values) >= SHORTEST and bool((np.diff(values) > 0).all())


def repeated_instants(table: LogTable) -> tuple[str, int] | None:
    """The column in which every instant stands once per signal, and how often; None where there is none."""
    for name, values in table.columns.items():
        changes = np.flatnonzero(values != values[0])
        count = int(changes[0]) if len(changes) else 0
        if not 2 <= count <= MOST_PARTS or len(values) % count:
            continue
        rows = values.reshape(-1, count)
        others = [x for other, x in table.columns.items() if other != name and np.ptp(x) > 0]
        if (rows == rows[:, :1]).all() and rises(rows[:, 0]) and any(alternates(x, count) for x in others):
            return name, count
    return None


def alternates(values: Array, count: int) -> bool:
    """Whether `count` signals alternate: each is smoother than all of them in turn."""
    return bool(np.sum(np.abs(values[count:] - values[:-count])) < 0.5 * np.sum(np.abs(np.diff(values))))


def parts(columns: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Every column as `count` columns."""
    found: dict[str, Array] = {}
    for name, values in columns.items():
        rows = values.reshape(-1, count).T if alternates(values, count) else values.reshape(count, -1)
        found |= {f"{name}{PART}{i + 1} of {count}": np.ascontiguousarray(row) for i, row in enumerate(rows)}
    return found
