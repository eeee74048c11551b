"""Numbers that stand for a missing value."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexviz.base.arrays import Indices
from flexviz.data.noise import SHORT, Channel

FEWEST = 3  # times that one number is written
FAR = 10.0  # usual steps by which it is away from both neighbours


def dropped(channel: Channel) -> Iterator[tuple[float, Indices]]:
    """Values that stand for a missing one, and where runs of them begin.

    They are 0, the least or the largest value, and far from the samples before and after.
    """
    y = channel.values
    steps = np.abs(np.diff(y))
    moving = steps[steps > 0]
    if not len(moving):
        return
    far = FAR * float(np.median(moving))
    longest = max(1, round(SHORT / float(np.median(np.diff(channel.time)))))
    for value in sorted({0.0, float(y.min()), float(y.max())}, key=lambda v: -np.count_nonzero(y == v)):
        edges = np.diff((y == value).astype(np.int8), prepend=0, append=0)
        start, stop = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        inside = (start > 0) & (stop < len(y)) & (stop - start <= longest)
        start, stop = start[inside], stop[inside]
        before, after = y[start - 1] - value, y[stop] - value
        near = np.minimum(np.abs(before), np.abs(after))
        lost = (near > far) & (np.abs(before - after) < near)
        if np.count_nonzero(lost) >= FEWEST:
            yield value, start[lost]
