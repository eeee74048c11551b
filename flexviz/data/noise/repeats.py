"""How long the values of a column last: a log may be faster than its drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices
from flexviz.data.noise.thresholds import THRESHOLDS

FEWEST = 50  # values that show how long each lasts
AROUND = 25  # samples before, and after, over which a speed is taken


@dataclass(frozen=True, eq=False)
class Repeats:
    """How long the values of a column last.

    Attributes:
        rows: (M,) where a value is new, from 0.
        lasts: rows per new value while the column moves; 1: each is new.
    """

    rows: Indices
    lasts: float


def repeats_of(y: Array) -> Repeats:
    """How long the values of `y` (N,) last; the counts of an encoder at slow speed are no repetitions.

    A column repeats where it does not change although it moves by several counts per row, or where it changes
    by several counts, and nearly all values last equally long, or multiples of the same number of rows.
    """
    steps = np.abs(np.diff(y))
    changed = np.flatnonzero(steps > 0) + 1
    rows = np.concatenate([[0], changed])
    if len(rows) < FEWEST or len(y) <= 2 * AROUND:
        return Repeats(rows, 1.0)
    lengths = np.diff(rows)[1:]
    k, mean, sizes = int(np.quantile(lengths, 0.1)), float(np.mean(lengths)), steps[steps > 0]
    several = np.median(sizes) > THRESHOLDS.held_steps * np.min(sizes)
    if k > 1 and several and np.mean(lengths % k == 0) > THRESHOLDS.held_regularly:
        return Repeats(rows, float(k))
    alike = np.sum(lengths[np.abs(lengths - mean) < 1.0]) / np.sum(lengths)  # share of the rows
    if mean > 1.5 and several and alike > THRESHOLDS.held_regularly:
        return Repeats(rows, mean)
    moving = _moving(y, steps)
    new = np.mean(steps[moving] > 0) if np.count_nonzero(moving) >= FEWEST else 1.0
    return Repeats(rows, 1.0 / float(new) if 0.0 < new < 1 / THRESHOLDS.repeated else 1.0)


def _moving(y: Array, steps: Array) -> Bools:
    """Steps (N − 1,) at which the column moves by several counts per row."""
    least = AROUND * THRESHOLDS.counts_per_row * smallest_step(steps)
    gone = y[AROUND:] - y[:-AROUND]
    before, after = gone[: -AROUND - 1], gone[AROUND + 1 :]  # on both sides: a single jump is no motion
    moving = np.zeros(len(steps), dtype=bool)
    moving[AROUND : AROUND + len(before)] = np.minimum(before * np.sign(after), np.abs(after)) > least
    # at its ends a signal that is limited stands still although nothing is stale
    return moving & (y[1:] < np.max(y)) & (y[1:] > np.min(y))


def smallest_step(steps: Array) -> float:
    """The smallest usual step, of absolute ones (N,) that are not all 0."""
    return float(np.quantile(steps[steps > 0], THRESHOLDS.count_quantile))


def new_rows(y: Array) -> Indices:
    """Rows of `y` (N,) with new values; all of them unless it repeats its values."""
    found = repeats_of(y)
    return found.rows if found.lasts > 1.0 else np.arange(len(y))
