"""Measurement noise, estimated from the raw samples."""

import numpy as np
from numpy.typing import NDArray

from flexviz.measurements import Segment

Array = NDArray[np.float64]

# Σ C(4, k)² = 70 is the variance of fourth differences of white noise of unit variance
_DIFFERENCE_GAIN = np.sqrt(70.0)


def white_noise(y: Array) -> Array:
    """Standard deviation of the white noise in each column of y (shape (N, m)), shape (m,).

    The fourth difference removes any smooth motion; the median ignores the few samples at jumps. Where most
    differences are zero (a coarse encoder at rest) their standard deviation is used instead.
    """
    difference = np.diff(y, 4, axis=0)
    if not len(difference):
        return np.zeros(y.shape[1])
    robust = np.median(np.abs(difference), axis=0) / 0.6745
    return np.where(robust > 0, robust, difference.std(axis=0)) / _DIFFERENCE_GAIN


def segments_noise(segments: list[Segment] | tuple[Segment, ...]) -> tuple[Array, Array]:
    """Noise of θ [rad] and τ [Nm] over several segments (root mean square), two arrays of shape (n,)."""
    weights = np.array([len(s) for s in segments], float)
    theta = np.array([white_noise(s.theta) for s in segments])
    tau = np.array([white_noise(s.tau) for s in segments])
    return (
        np.sqrt(np.average(theta**2, axis=0, weights=weights)),
        np.sqrt(np.average(tau**2, axis=0, weights=weights)),
    )
