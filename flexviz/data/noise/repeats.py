"""Values that are written again: a log faster than its drive, a value that is stale, a column that rests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices
from flexviz.base.spelling import number
from flexviz.data.noise.findings import Channel, Remedy, SampleFinding, runs
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
    least = AROUND * THRESHOLDS.counts_per_row * _count(steps)
    gone = y[AROUND:] - y[:-AROUND]
    before, after = gone[: -AROUND - 1], gone[AROUND + 1 :]  # on both sides: a single jump is no motion
    moving = np.zeros(len(steps), dtype=bool)
    moving[AROUND : AROUND + len(before)] = np.minimum(before * np.sign(after), np.abs(after)) > least
    # at its ends a signal that is limited stands still although nothing is stale
    return moving & (y[1:] < np.max(y)) & (y[1:] > np.min(y))


def _count(steps: Array) -> float:
    """The smallest usual step, of absolute ones (N,) that are not all 0."""
    return float(np.quantile(steps[steps > 0], THRESHOLDS.count_quantile))


def new_rows(y: Array) -> Indices:
    """Rows of `y` (N,) with new values; all of them unless it repeats its values."""
    found = repeats_of(y)
    return found.rows if found.lasts > 1.0 else np.arange(len(y))


def check_repeats(channel: Channel, moves: Bools) -> list[SampleFinding]:
    """Repeated values, or a value that stands still while the joint moves; `moves` (N,): where it does."""
    y = channel.values
    if np.ptp(y) == 0.0:
        found = f"the value is {number(float(y[0]))} in all {len(y)} rows"
        cause = "a joint that rests or has no motor, or a channel that was not recorded"
        texts = found, cause, "a recorded signal; leave such a joint out of [joints]: it then stays locked"
        return [channel.finding("constant", np.arange(len(y)), texts)]
    found = repeats_of(y)
    stale = _stale(channel, found, moves)
    findings = []
    remedy = Remedy("fresh", True)
    if found.lasts >= THRESHOLDS.repeated:
        repeated = np.setdiff1d(np.arange(len(y)), found.rows)
        rate = 1 / (found.lasts * float(np.median(np.diff(channel.time))))
        text = f"each value stands in {number(found.lasts, 3)} rows on average, {number(rate, 3)} Hz"
        texts = text, "a log faster than its drive", "new values only; those between are interpolated"
        findings.append(channel.finding("repeated", repeated, texts, remedy))
    if len(stale):
        first, last = max(runs(stale), key=lambda run: run[1] - run[0])
        longest = float(channel.time[last] - channel.time[first])
        text = f"the value stands still for up to {number(longest, 3)} s while the joint moves"
        texts = text, "stale values: lost messages, or a drive that is off", "measured values only"
        findings.append(channel.finding("stale", stale, texts, remedy))
    return findings


def _stale(channel: Channel, found: Repeats, moves: Bools) -> Indices:
    """Samples (m,) that repeat the one before for much longer than others do, while the joint moves."""
    y = channel.values
    ends = np.append(found.rows, len(y))
    lengths = np.diff(ends)
    usual = np.quantile(lengths, 0.95)
    least = max(THRESHOLDS.stale_runs * usual, THRESHOLDS.stale / float(np.median(np.diff(channel.time))))
    extremes = (y[found.rows] == y.min()) | (y[found.rows] == y.max())  # a limit of the drive, if not zero
    extremes &= y[found.rows] != 0.0
    moved = np.concatenate([[0], np.cumsum(moves)])
    mostly = (moved[ends[1:]] - moved[ends[:-1]]) > 0.5 * lengths
    count = _count(np.abs(np.diff(y)))
    jumps = np.abs(np.diff(y[found.rows]))
    then = np.maximum(np.append(jumps, 0.0), np.append(0.0, jumps))  # a slow one goes on by single counts
    long = (lengths > least) & mostly & ~extremes & (then > THRESHOLDS.counts_per_row * count)
    spans = [np.arange(a + 1, b) for a, b in zip(ends[:-1][long], ends[1:][long], strict=True)]
    return np.concatenate(spans) if spans else np.zeros(0, dtype=int)
