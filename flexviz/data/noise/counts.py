"""Counts of an encoder, or the digits with which a column was written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.data.measurements import Segment
from flexviz.data.noise.thresholds import THRESHOLDS

ENOUGH = 20_000  # samples that show the digits with which a column was written
SHORT_STOP = 0.4  # [s] a joint that stands longer rests


def count_of(y: Array) -> float:
    """The count of which the steps of a column (N,) are multiples; zero if they are not."""
    steps = np.abs(np.diff(y))
    steps = steps[steps > THRESHOLDS.rounding * float(np.max(np.abs(y)))]
    if not len(steps):
        return 0.0
    count = float(np.quantile(steps, THRESHOLDS.count_quantile))
    multiples = steps / count
    on_grid = np.abs(multiples - np.round(multiples)) < THRESHOLDS.off_count
    many = len(np.unique(np.round(y / count))) > THRESHOLDS.fewest_counts
    return count if many and np.mean(on_grid) > THRESHOLDS.held_regularly else 0.0


def in_counts(segments: Sequence[Segment]) -> Bools:
    """Which positions are still in the counts of their encoder, shape (n,): steps are multiples of one.

    No filter's output has such steps, but for a power of ten [rad], [°]: the digits that were written.
    """
    found = []
    for j in range(segments[0].theta.shape[1]):
        parts = [(s.theta[:, j], s.step) for s in segments]
        count = count_of(np.concatenate([y for y, _ in parts])[:ENOUGH]) or standing_count(parts)
        digits = np.log10([count, np.degrees(count)]) if count > 0 else np.zeros(2)
        found.append(bool(np.all(np.abs(digits - np.round(digits)) > THRESHOLDS.off_count)))
    return np.array(found)


def standing_count(parts: Sequence[tuple[Array, float]]) -> float:
    """The count of a position that stands between two of them in motion, 0.0 of one that does not.

    `parts`: (N,) each, and their steps [s]. Standing values remain where a jittering clock was resampled.
    """
    standing, samples, values = 0, 0, list[Array]()
    for y, step in parts:
        still = np.abs(np.diff(y)) <= THRESHOLDS.rounding * float(np.max(np.abs(y)))
        edges = np.flatnonzero(np.diff(np.concatenate(([0], still, [0]))))
        first, last = edges[::2], edges[1::2]
        short = (last - first) * step < SHORT_STOP
        standing += int(np.sum((last - first)[short]))
        samples += len(y) - int(np.sum((last - first)[~short]))
        values.append(y[first[short]])
    if standing <= (1 - THRESHOLDS.held_regularly) * samples:
        return 0.0
    steps = np.diff(np.unique(np.concatenate(values)))
    steps = steps[steps > THRESHOLDS.position_resolution]
    return float(np.quantile(steps, THRESHOLDS.count_quantile, method="lower")) if len(steps) else 0.0
