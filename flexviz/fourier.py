"""Lengths that a Fourier transform is quick for, and how often the lines of its spectrum count.

NumPy's transforms are used: SciPy's are the same code, but loading them takes a tenth of a second.
"""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array


def quick_length(count: int) -> int:
    """The least length from `count` on that has no prime factor above 5.

    >>> quick_length(1021), quick_length(1024), quick_length(1)
    (1024, 1024, 1)
    """
    count = int(count)  # NumPy's integers have no bit_length
    best = 1 << (count - 1).bit_length()
    fives = 1
    while fives < best:
        factor = fives
        while factor < best:
            best = min(best, factor << (-(-count // factor) - 1).bit_length())
            factor *= 3
        fives *= 5
    return best


def line_counts(length: int) -> Array:
    """How often each line of a real signal's one-sided spectrum counts: twice, but for its ends."""
    counts = np.full(length // 2 + 1, 2.0)
    counts[0] = 1.0
    if length % 2 == 0:
        counts[-1] = 1.0
    return counts
