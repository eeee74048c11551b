"""Residuals of which some samples count, and how much they scatter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.motion.thresholds import MOTION
from flexviz.base.arrays import Array, Bools

PASSES = 3  # in which outliers are told from the rest
UNKNOWN_PASSES = 5  # before, in which unknown torques are
FALL = 0.1  # of a variance, to which it falls at most in a pass


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

    @property
    def variance_unknown(self) -> Array | float:
        """What is unknown, zero if nothing."""
        return 0.0 if self.unknown is None else self.unknown

    def weights(self, sigma: Array) -> Array | Bools:
        """Part of each sample's variance that is the model's own, of deviation σ, (n,): shape (N, n)."""
        if self.unknown is None:
            return self.used
        finite = np.where(np.isfinite(sigma), sigma, 0.0) ** 2
        return self.used * np.where(np.isfinite(sigma), finite / (finite + self.unknown + 1e-300), 1.0)


def deviations(parts: Sequence[Residuals], outlier: float = np.inf) -> Array:
    """Standard deviation of residuals with outliers clipped, shape (n,), beside what is unknown.

    Of samples of variance σ² + u, of each of which w = σ² / (σ² + u) is its own, likelihood is highest
    where σ² Σ w² = Σ w² (r² − u).
    """
    sigma = np.full(parts[0].values.shape[1], np.inf)
    known = all(part.unknown is None for part in parts)
    first = 1 if known else UNKNOWN_PASSES
    for k in range(first + (0 if known and np.isinf(outlier) else PASSES)):
        limit = outlier * sigma if k >= first else np.inf
        total = count = np.zeros(len(sigma))
        for part in parts:
            own = 1.0 * part.weights(sigma)
            squares = np.minimum(np.abs(part.values) * np.sqrt(own), limit) ** 2
            if part.unknown is not None and np.isfinite(sigma).all():
                squares -= own * part.unknown
            total, count = total + np.sum(own * squares, axis=0), count + np.sum(own**2, axis=0)
        least = 0.0 if known or np.isinf(sigma).any() else FALL * sigma**2
        sigma = np.sqrt(np.maximum(total / np.maximum(count, 1e-300), least)) + 1e-300
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
