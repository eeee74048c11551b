"""Lengths of discrete Fourier transforms, and how often the lines of a spectrum count."""

from __future__ import annotations

from typing import SupportsInt

import numpy as np

from flexviz.base.arrays import Array


def fast_length(least: SupportsInt) -> int:
    """The smallest length 2^a 3^b 5^c from `least` on, of which a transform of real samples is fast.

    As `scipy.fft.next_fast_len`, which would load 20 MB for it.
    """
    length, odd = int(least), [1]
    for factor in (3, 5):
        powers = [factor**k for k in range(length.bit_length() + 1)]
        odd = [one * power for one in odd for power in powers if one * power < 2 * length]
    return min(one << (-(-length // one) - 1).bit_length() for one in odd)


def line_counts(length: int) -> Array:
    """How often each line of a real signal's one-sided spectrum counts: twice, but for its ends."""
    counts = np.full(length // 2 + 1, 2.0)
    counts[0] = 1.0
    if length % 2 == 0:
        counts[-1] = 1.0
    return counts
