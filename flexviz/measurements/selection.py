"""Which samples to use: friction around standstill is unreliable."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.measurements.data import Array


def moving(velocity: Array, threshold: float | Array) -> NDArray[np.bool_]:
    """Where each joint moves faster than `threshold`.

    Parameters
    ----------
    velocity: (N, n) [rad/s].
    threshold: one number or (n,) [rad/s]; 0 keeps everything.

    Returns
    -------
    (N, n) True where |velocity| is above its joint's threshold (everywhere for a threshold of 0).
    """
    limit = np.asarray(threshold, dtype=float)
    n = velocity.shape[1]
    if limit.shape not in ((), (n,)) or not np.all(np.isfinite(limit)) or np.any(limit < 0.0):
        raise InputError(
            f"low-speed threshold {threshold!r}: one number of at least 0 or {n} of them would be right"
        )
    return (np.abs(velocity) > limit) | (np.broadcast_to(limit, (n,)) == 0.0)


def low_speed_threshold(velocity: Array, part: float = 0.02) -> Array:
    """(n,) a threshold for `moving`: this part of each joint's fastest speed in `velocity` (N, n) [rad/s]."""
    return part * np.max(np.abs(velocity), axis=0)
