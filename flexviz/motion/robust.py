"""Residuals of which some samples count, and how much they scatter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.arrays import Array, Bools
from flexviz.motion.thresholds import MOTION

PASSES = 4  # in which outliers and unknown torques are told from the rest


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one part of the data, the fit groups or the validation groups.

    Attributes:
        values: shape (N, n).
        used: shape (N, n), samples that count.
        blocks: contiguous samples.
        unknown: shape (N, n), variance that the model states for them beside its own error; None: zero.
    """

    values: Array
    used: Bools
    blocks: Sequence[slice]
    unknown: Array | None = None

    def weights(self, sigma: Array) -> Array | Bools:
        """How much each sample says of a deviation σ, shape (n,): shape (N, n)."""
        if self.unknown is None:
            return self.used
        finite = np.where(np.isfinite(sigma), sigma, 0.0) ** 2
        return self.used * np.where(np.isfinite(sigma), finite / (finite + self.unknown + 1e-300), 1.0)


def deviations(parts: Sequence[Residuals], outlier: float = np.inf) -> Array:
    """Standard deviation of residuals with outliers clipped, shape (n,), beside what is unknown."""
    n = parts[0].values.shape[1]
    limit = sigma = np.full(n, np.inf)
    for _ in range(1 if np.isinf(outlier) and all(p.unknown is None for p in parts) else PASSES):
        weights = [p.weights(sigma) for p in parts]
        count = np.maximum(sum(w.sum(axis=0) for w in weights), 1)
        pairs = zip(parts, weights, strict=True)
        total = sum(np.sum(np.minimum(np.abs(p.values), limit) ** 2 * w, axis=0) for p, w in pairs)
        sigma = np.sqrt(total / count) + 1e-300
        limit = outlier * sigma
    return sigma


def huber(ratio: Array, outlier: float) -> Array:
    """Huber's loss of residuals |r|/σ, of any shape: half the square, linear from `outlier` on [nats]."""
    return np.where(ratio < outlier, 0.5 * ratio**2, outlier * (ratio - 0.5 * min(outlier, 1e150)))


def robust_weights(residual: Array, floor: Array, used: Bools) -> tuple[Array, float]:
    """Huber's weights of residuals of unknown variance, and twice the negative log likelihood.

    Shape (N, n): residual [Nm], samples that count, weights [1/Nm]; `floor`, shape (n,): the smallest σ [Nm].
    """
    limit = MOTION.outlier
    sigma = np.maximum(deviations([Residuals(residual, used, ())], limit), floor)
    ratio = np.abs(residual) / sigma * used
    weights = used * np.sqrt(np.minimum(1.0, limit / np.maximum(ratio, 1e-12))) / sigma
    misfit = used.sum(axis=0) @ np.log(sigma) + huber(ratio, limit).sum()
    return weights, 2 * float(misfit)
