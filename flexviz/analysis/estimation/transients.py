"""Loud samples at the ends of a record: left out of a fit, but counted when models are compared."""

from __future__ import annotations

import numpy as np

from flexviz.analysis.estimation.thresholds import ESTIMATION
from flexviz.base.arrays import Array, Bools


def outside_transients(r: Array) -> tuple[Bools, float]:
    """Samples of one stretch outside the transients at its ends, and what the others cost.

    The length of a transient depends on how the record starts. Windows of 1/80 of the stretch are dropped at
    both ends up to the innermost one, within an eighth of the stretch, whose energy exceeds
    `ESTIMATION.transient` times the median.

    Args:
        r: shape (N, n), whitened residual.

    Returns:
        shape (N,), samples to use, and Σ N log max(χ, 1) over the windows that were dropped: another model
        may have no transient there.
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
    dropped = r[~used] ** 2
    first_rows = np.arange(0, len(dropped), window)
    sizes = np.diff(first_rows, append=len(dropped))[:, None]
    chi = np.add.reduceat(dropped, first_rows) / sizes if len(dropped) else dropped
    return used, float(np.sum(sizes * np.log(np.maximum(chi, 1.0))))
