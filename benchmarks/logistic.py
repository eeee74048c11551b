"""Logistic regression of "right" on what was stated, for the studies' calibrations."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Array = NDArray[np.float64]


def logistic(
    columns: Array, right: NDArray[np.bool_], centre: Array, shrink: Array, signs: Sequence[int]
) -> Array:
    """Weights w (K,) of the log-odds columns @ w that make `right` likeliest.

    Args:
        columns: shape (M, K), features of each finding.
        right: shape (M,), whether each was right.
        centre: shape (K,), weights before any finding.
        shrink: shape (K,), weight of each squared deviation from `centre`.
        signs: of each weight: 1, -1, or 0 for either.
    """

    def cost(w: Array) -> tuple[float, Array]:
        odds = columns @ w
        loss = np.logaddexp(0.0, np.where(right, -odds, odds)).sum() + shrink @ (w - centre) ** 2
        slope = columns.T @ (1 / (1 + np.exp(-odds)) - right) + 2 * shrink * (w - centre)
        return float(loss), slope

    bounds = [(0.0 if sign > 0 else None, 0.0 if sign < 0 else None) for sign in signs]
    return minimize(cost, centre, jac=True, bounds=bounds, method="L-BFGS-B").x


def half(case: str) -> int:
    """Which half of the cases one belongs to, by its name: 0 or 1."""
    return zlib.crc32(case.encode()) % 2
