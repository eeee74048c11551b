"""Samples of a motion: which count, and how much they scatter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Signals

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion


def robust_deviation(residual: Array, floor: Array, used: NDArray[np.bool_]) -> Array:
    """Standard deviation of each column of (N, n) with outliers clipped, at least `floor`."""
    count = np.maximum(used.sum(axis=0), 1)
    sigma = np.sqrt(np.sum(residual**2 * used, axis=0) / count) + 1e-300
    for _ in range(3):
        clipped = np.minimum(np.abs(residual), LIMITS.outlier * sigma) * used
        sigma = np.sqrt(np.sum(clipped**2, axis=0) / count) + 1e-300
    return np.maximum(sigma, floor)


def robust_weights(residual: Array, floor: Array, used: NDArray[np.bool_]) -> tuple[Array, Array, float]:
    """Huber's weights of residuals of unknown variance.

    Args:
        residual: shape (N, n) [Nm].
        floor: shape (n,), smallest σ.
        used: shape (N, n), samples that count.

    Returns:
        weights (N, n) [1/Nm], σ (n,) [Nm], and twice the negative log likelihood.
    """
    sigma = robust_deviation(residual, floor, used)
    ratio = np.abs(residual) / sigma * used
    weights = used * np.sqrt(np.minimum(1.0, LIMITS.outlier / np.maximum(ratio, 1e-12))) / sigma
    loss = np.where(ratio < LIMITS.outlier, ratio**2, LIMITS.outlier * (2 * ratio - LIMITS.outlier))
    return weights, sigma, 2 * float(used.sum(axis=0) @ np.log(sigma)) + float(loss.sum())


def in_motion(signals: Signals) -> NDArray[np.bool_]:
    """Samples at which a joint moves, or has moved from rest by more than `LIMITS.start_angle`: (N, n)."""
    position, speed = signals.theta[0], np.abs(signals.theta[1])
    moving = speed > LIMITS.standstill_speed * np.quantile(speed, 0.95, axis=0)
    for block in signals.blocks:
        rows = block.rows
        for j in range(moving.shape[1]):
            part = moving[rows, j]
            starts = rows.start + np.flatnonzero(np.diff(part.astype(int), prepend=0) > 0)
            for start in starts:
                away = np.abs(position[start : rows.stop, j] - position[start, j]) > LIMITS.start_angle
                stop = start + (int(np.argmax(away)) if away.any() else rows.stop - start)
                moving[start:stop, j] = False
    return moving


def loud_at_rest(residual: Array, moving: NDArray[np.bool_], floor: Array) -> NDArray[np.bool_]:
    """Joints whose residual (N, n) is much larger where they do not move than where they do, shape (n,)."""
    squares = residual**2
    rest = np.sum(squares * ~moving, axis=0) / np.maximum((~moving).sum(axis=0), 1)
    moved = np.sum(squares * moving, axis=0) / np.maximum(moving.sum(axis=0), 1)
    loud = np.sqrt(rest) > LIMITS.far_off * floor
    return loud & (rest > LIMITS.standstill_ratio**2 * moved)
