"""Where a position jumps: by more than motion, noise and counts explain, and where it comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexviz.base.arrays import Array, Indices
from flexviz.data.noise.channels import Channel
from flexviz.data.noise.estimates import white_noise
from flexviz.data.noise.repeats import new_rows
from flexviz.data.noise.thresholds import SHORT, THRESHOLDS

SHORTEST = 32  # samples that a repair has to leave
PASSES = 10  # over samples that jump away and back


def jumped(channel: Channel, fastest: float) -> Indices:
    """Samples (m,) at which a position has jumped: by more than motion, noise and counts explain."""
    theta = channel.values * channel.size
    rows = new_rows(theta)
    if len(rows) < 4:
        return np.zeros(0, dtype=int)
    steps, seconds = np.diff(theta[rows]), np.diff(channel.time[rows])
    count = np.abs(steps)[steps != 0.0]
    usual = max(
        THRESHOLDS.jump_noise * float(white_noise(theta[:, None])[0]),
        THRESHOLDS.jump_steps * float(np.median(count)) if len(count) else 0.0,
    )
    least = max(THRESHOLDS.jump, min(usual, THRESHOLDS.jump_beyond_noise))
    # where time does not go on, another stretch begins
    return rows[1:][(sudden(steps) > np.maximum(least, fastest * seconds)) & (seconds > 0.0)]


def sudden(steps: Array) -> Array:
    """The part of each step, shape (N,), that smooth motion does not explain.

    How much it differs from the steps one before and one after, the smaller counts, so that a new speed is no
    jump; the same two before and two after, so that a jump may take two samples; at most the step itself, so
    that the samples between two jumps are none.
    """
    around = np.pad(steps, 2, mode="reflect")
    one, two = (
        np.minimum(
            np.abs(steps - around[2 - k : len(around) - 2 - k]),
            np.abs(steps - around[2 + k : len(around) - 2 + k or None]),
        )
        for k in (1, 2)
    )
    return np.minimum(np.maximum(one, two), np.abs(steps))


def outliers(channel: Channel, fastest: float = 0.0) -> tuple[Indices, int]:
    """Samples (m,) between a jump and the jump back, as short as dropped values; jumps that are left then.

    Where two motions cross, single jumps are too small to be seen until the others are taken out.
    """
    away = np.zeros(0, dtype=int)
    for _ in range(PASSES):
        kept = np.setdiff1d(np.arange(len(channel.values)), away)
        if len(kept) < SHORTEST:
            break
        part = replace(channel, time=channel.time[kept], values=channel.values[kept], incomplete=None)
        at = jumped(part, fastest)
        found = _between(part, at)
        if not len(found):
            return away, len(at)
        away = np.sort(np.concatenate([away, kept[found]]))
    return away, len(channel.values)


def _between(channel: Channel, at: Indices) -> Indices:
    """Samples (m,) between a jump and the jump back, of the jumps `at`."""
    y, time = channel.values, channel.time
    longest = max(SHORT, 1.5 * float(np.median(np.diff(time))))
    if not len(at):
        return at
    edges = np.concatenate([[0], at, [len(y)]])
    sizes = np.diff(edges)
    away: list[int] = []
    last = -1  # row before this piece of those that stay
    for first, size, after in zip(edges[:-1], sizes, [*sizes[1:], sizes[-2]], strict=True):
        end = first + size
        short = size <= after and time[min(end, len(y) - 1)] - time[first] <= longest
        comes_back = last < 0 or end == len(y) or abs(y[end] - y[last]) < 0.5 * abs(y[first] - y[last])
        if short and comes_back:
            away += range(int(first), int(end))
        else:
            last = int(end) - 1
    return np.array(away, dtype=int)
