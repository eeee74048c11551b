"""Guess which column says when, and in which unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexviz.importing.clocks import likely_clocks
from flexviz.importing.log import Log, Table
from flexviz.importing.names import words
from flexviz.importing.units import TIME, unit_in
from flexviz.measurements import Array

USUAL = (2e-4, 5e-2)  # [s] steps that robots are recorded with
POSSIBLE = (2e-5, 0.2)  # [s]


def guess_time(log: Log, used: Sequence[str]) -> tuple[dict[str, Any], str, dict[str, str]]:
    """The keys of [time], why (or "MISSING: …"), and column -> its own time column where that differs."""
    every = log.columns
    tables = {id(every[column]): every[column] for column in used}
    chosen: dict[str, str] = {}
    for column in used:
        if every[column].clock is not None:
            continue
        likely = likely_clocks(every[column])
        if not likely:
            return (
                {},
                "MISSING: [time] column, or step = seconds from row to row: no column looks like a time",
                {},
            )
        chosen[column] = nearest(column, likely)
    if not chosen:
        return {}, "", {}
    most = max(dict.fromkeys(chosen.values()), key=list(chosen.values()).count)
    table = next(table for table in tables.values() if most in table.columns)
    unit, why = guess_unit(table, most)
    own = {column: time for column, time in chosen.items() if time != most}
    return {"column": most} | ({"unit": unit} if unit != "s" else {}), why, own


def nearest(column: str, times: Sequence[str]) -> str:
    """The time that shares most words with a column's name: motor.t for motor.q."""
    said = set(words(column))
    return max(times, key=lambda time: (len(said & set(words(time))), -times.index(time)))


def guess_unit(table: Table, name: str) -> tuple[str, str]:
    """Unit of a time column, and why."""
    step = median_step(table.columns[name])
    stated = table.units.get(name) or unit_in(name)
    if stated in TIME:
        return str(stated), f"step {step * TIME[str(stated)]:.4g} s; the unit is stated"
    for bounds in (USUAL, POSSIBLE):
        for unit, size in TIME.items():
            if bounds[0] <= step * size <= bounds[1]:
                return unit, f"step {step * size:.4g} s, if the unit is right"
    return "s", f"step {step:.4g}: is the unit s?"


def median_step(values: Array) -> float:
    """The usual difference of two rows."""
    known = values if values.dtype.kind == "i" else values[np.isfinite(values)]
    return float(np.median(np.diff(known)))
