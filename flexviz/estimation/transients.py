"""Transients at the ends of a record, which the residual of no model describes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.thresholds import ESTIMATION

Array = NDArray[np.float64]


def outside_transients(r: Array) -> NDArray[np.bool_]:
    """Samples of one stretch outside the transients at its ends, shape (N,).

    The length of a transient depends on how the record starts. Windows of 1/80 of the stretch are dropped at
    both ends up to the innermost one, within an eighth of the stretch, whose energy exceeds
    `ESTIMATION.transient` times the median.
    """
    window = max(3, len(r) // 80)
    count = len(r) // window
    energy = (r[: count * window] ** 2).reshape(count, -1).mean(axis=1)
    loud = energy > ESTIMATION.transient * np.median(energy)
    used = np.ones(len(r), bool)
    edge = count // 8
    first, last = np.flatnonzero(loud[:edge]), np.flatnonzero(loud[::-1][:edge])
    if first.size:
        used[: (first[-1] + 1) * window] = False
    if last.size:
        used[(count - last[-1] - 1) * window :] = False
    return used


def above_noise(chi: Array, count: int) -> float:
    """Σ_j N log max(χ_j, 1) of N samples with a mean square of χ (n,)."""
    return count * float(np.log(np.maximum(chi, 1.0)).sum())
