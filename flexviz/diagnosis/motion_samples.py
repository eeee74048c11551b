"""Samples of a motion: which count, and how much they scatter."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Signals

Array = NDArray[np.float64]
Phases = NDArray[np.int8]

LIMITS, OUTLIER = THRESHOLDS.standstill, THRESHOLDS.criterion.outlier


def robust_deviation(residual: Array, floor: Array, used: NDArray[np.bool_]) -> Array:
    """Standard deviation of each column of (N, n) with outliers clipped, at least `floor`."""
    count = np.maximum(used.sum(axis=0), 1)
    sigma = np.sqrt(np.sum(residual**2 * used, axis=0) / count) + 1e-300
    for _ in range(3):
        clipped = np.minimum(np.abs(residual), OUTLIER * sigma) * used
        sigma = np.sqrt(np.sum(clipped**2, axis=0) / count) + 1e-300
    return np.maximum(sigma, floor)


def robust_weights(residual: Array, floor: Array, used: NDArray[np.bool_]) -> tuple[Array, float]:
    """Huber's weights of residuals of unknown variance.

    Args:
        residual: shape (N, n) [Nm].
        floor: shape (n,), smallest σ.
        used: shape (N, n), samples that count.

    Returns:
        weights (N, n) [1/Nm], and twice the negative log likelihood.
    """
    sigma = robust_deviation(residual, floor, used)
    ratio = np.abs(residual) / sigma * used
    weights = used * np.sqrt(np.minimum(1.0, OUTLIER / np.maximum(ratio, 1e-12))) / sigma
    loss = np.where(ratio < OUTLIER, ratio**2, OUTLIER * (2 * ratio - OUTLIER))
    return weights, 2 * float(used.sum(axis=0) @ np.log(sigma)) + float(loss.sum())


class Phase(IntEnum):
    """Of a joint's motion. Where standstill is left out, a joint has the number of the first that counts."""

    REST = 0
    START = 1  # moving, but not yet by more than `LIMITS.start_angle` from where it rested
    MOTION = 2


def phases(signals: Signals) -> Phases:
    """The `Phase` of each sample and joint, shape (N, n)."""
    position, speed = signals.theta[0], np.abs(signals.theta[1])
    moving = speed > LIMITS.still * np.quantile(speed, 0.95, axis=0)
    phase = np.where(moving, Phase.MOTION, Phase.REST).astype(np.int8)
    for block in signals.blocks:
        rows = block.rows
        for j in range(moving.shape[1]):
            part = moving[rows, j]
            starts = rows.start + np.flatnonzero(np.diff(part.astype(int), prepend=0) > 0)
            for start in starts:
                away = np.abs(position[start : rows.stop, j] - position[start, j]) > LIMITS.start_angle
                stop = start + (int(np.argmax(away)) if away.any() else rows.stop - start)
                phase[start:stop, j] = np.minimum(phase[start:stop, j], Phase.START)
    return phase
