"""What signatures explain beside a model's own parameters, by Gram matrices.

What the model can do by itself is taken out of a signature h by h − Z H⁻¹ Zᵀ h, with the weighted Jacobian Z
and H = Zᵀ Z + the prior's Hessian. Lengths and products of what is left need only Zᵀ h.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.linear_algebra import scaled_inverse

Array = NDArray[np.float64]
Weigh = Callable[[Array, int], Array]  # columns (N_block, n, C) of a stretch, its index → (N_block·n, C)

LEAST_LEFT = 1e-10  # share of a signature's squared length; below it the model's own parameters do the same


class Projection:
    """Gram matrices of signatures, what the model can do taken out of them.

    Args:
        residual: shape (M,), weighted.
        instruments: shape (M, P), weighted Jacobian of the present model.
        hessian: shape (P, P), instrumentsᵀ instruments + the prior's.
    """

    def __init__(self, residual: Array, instruments: Array, hessian: Array) -> None:
        self.residual, self.instruments = residual, instruments
        self._inverse = scaled_inverse(hessian, rcond=1e-13)
        self._gram = instruments.T @ instruments
        self._along = instruments.T @ residual

    def normal(self, columns: Array, rows: slice | None = None) -> tuple[Array, Array]:
        """Gram matrix (C, C) and products with the residual (C,) of what is left of weighted signatures.

        Args:
            columns: shape (M_rows, C).
            rows: where they are not zero.
        """
        rows = slice(None) if rows is None else rows
        inside = self.instruments[rows].T @ columns
        share = self._inverse @ inside
        gram = columns.T @ columns
        full = np.diag(gram).copy()
        gram += share.T @ (self._gram @ share) - 2 * (inside.T @ share)
        along = columns.T @ self.residual[rows] - share.T @ self._along
        gram = 0.5 * (gram + gram.T)
        dead = np.diag(gram) <= LEAST_LEFT * full
        gram[dead] = gram[:, dead] = along[dead] = 0.0
        return gram, along

    def rest(self, columns: Array, rows: slice | None = None) -> Array:
        """What is left of weighted signatures (M_rows, C) themselves, shape (M, C)."""
        rows = slice(None) if rows is None else rows
        share = self._inverse @ (self.instruments[rows].T @ columns)
        out = -(self.instruments @ share)
        out[rows] += columns
        return out
