"""How often the lines of a spectrum count."""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array


def line_counts(length: int) -> Array:
    """How often each line of a real signal's one-sided spectrum counts: twice, but for its ends."""
    counts = np.full(length // 2 + 1, 2.0)
    counts[0] = 1.0
    if length % 2 == 0:
        counts[-1] = 1.0
    return counts
