"""The inverse noise covariance of one stretch, as something that can be applied.

Measurement noise is taken care of by the `Whitener`. What is not known of friction at reversals (`undecided`)
adds to it a few columns V of unknown size: the covariance becomes 1 + V Vᵀ in whitened terms, and a symmetric
square root of its inverse is P = 1 − U (1 − (1 + S²)^(−½)) Uᵀ with V = U S ….
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.whitening import Whitener

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseWeighting:
    """W: y → samples of unit variance, for one stretch.

    Attributes:
        whitener: of the measurement noise.
        basis: shape (N·n, M), U; None without unknown columns.
        size: shape (M,), S.
    """

    whitener: Whitener
    basis: Array | None = None
    size: Array | None = None

    def with_unknown(self, columns: Array) -> NoiseWeighting:
        """The same with unknown columns, shape (N, n, M), each of unit variance."""
        flat = self.whitener.apply(columns).reshape(-1, columns.shape[2])
        # by the small Gram matrix: directions far below one unit change nothing
        squares, turn = np.linalg.eigh(flat.T @ flat)
        kept = squares > 1e-6 * max(float(squares[-1]), 1e-300)
        size = np.sqrt(squares[kept])
        return NoiseWeighting(self.whitener, flat @ turn[:, kept] / size, size)

    def apply(self, y: Array) -> Array:
        """P W y for y of shape (N, n) or (N, n, P): the same shape."""
        return self._project(self.whitener.apply(y))

    def transposed(self, y: Array) -> Array:
        """(P W)ᵀ y for y of shape (N, n, P): the same shape."""
        return self.whitener.transposed(self._project(y))

    def unknown_share(self, y: Array) -> Array:
        """yᵀ P V: what the unknown columns add to the score of instruments y (N, n, P), shape (P, M)."""
        if self.basis is None or self.size is None:
            return np.zeros((y.shape[2], 0))
        flat = y.reshape(len(self.basis), -1)
        return (flat.T @ self.basis) * (self.size / np.sqrt(1 + self.size**2))

    @property
    def log_determinant(self) -> float:
        """Of 1 + V Vᵀ: what the freedom of the unknown columns costs in likelihood (twice its logarithm)."""
        return 0.0 if self.size is None else float(np.log1p(self.size**2).sum())

    def _project(self, y: Array) -> Array:
        if self.basis is None or self.size is None:
            return y
        rows = y.reshape(len(self.basis), -1)
        shrink = 1 - 1 / np.sqrt(1 + self.size**2)
        return (rows - self.basis @ (shrink[:, None] * (self.basis.T @ rows))).reshape(y.shape)
