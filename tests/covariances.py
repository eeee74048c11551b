"""Covariances of stationary and slowly varying noise as plain matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def dense_covariance(lagged: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance of all samples, (N n, N n), from that of each with the earlier ones, (lags, N, n, n)."""
    _, count, n, _ = lagged.shape
    dense = np.zeros((count, n, count, n))
    for t in range(count):
        for k in range(t + 1):
            dense[t, :, t - k] = lagged[k, t]
            dense[t - k, :, t] = lagged[k, t].T
    return dense.reshape(count * n, count * n)
