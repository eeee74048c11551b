"""Samples of a motion: which count, and how much they scatter."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.criterion import Residuals, deviations, huber
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Signals

Array = NDArray[np.float64]
Phases = NDArray[np.int8]

LIMITS, OUTLIER = THRESHOLDS.standstill, THRESHOLDS.criterion.outlier
LONGEST_EDGE = 0.15  # share of the shortest stretch that is dropped at each of its ends at most


def robust_weights(residual: Array, floor: Array, used: NDArray[np.bool_]) -> tuple[Array, float]:
    """Huber's weights of residuals of unknown variance, and twice the negative log likelihood.

    Shape (N, n): residual [Nm], samples that count, weights [1/Nm]; `floor`, shape (n,): the smallest σ [Nm].
    """
    sigma = np.maximum(deviations([Residuals(residual, used, ())], OUTLIER), floor)
    ratio = np.abs(residual) / sigma * used
    weights = used * np.sqrt(np.minimum(1.0, OUTLIER / np.maximum(ratio, 1e-12))) / sigma
    misfit = used.sum(axis=0) @ np.log(sigma) + huber(ratio, OUTLIER).sum()
    return weights, 2 * float(misfit)


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
