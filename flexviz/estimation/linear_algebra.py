"""Linear systems whose unknowns have units that differ by many orders of magnitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def scaled_solve(matrix: Array, right: Array) -> Array:
    """Solve a symmetric positive system with its diagonal scaled to one; least squares where singular."""
    scale = _scale(matrix)
    scaled = matrix * scale[:, None] * scale
    try:
        return scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:
        return scale * np.linalg.lstsq(scaled, scale * right, rcond=1e-12)[0]


def scaled_inverse(matrix: Array, rcond: float = 1e-14) -> Array:
    """Pseudoinverse of a symmetric matrix, its diagonal scaled to one; `rcond` as in `numpy.linalg.pinv`."""
    scale = _scale(matrix)
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale, rcond=rcond, hermitian=True)
    return inverse * scale[:, None] * scale


def least_norm_solve(matrix: Array, right: Array) -> Array:
    """Solve a symmetric system for right sides (P, K) by pseudoinverse, its diagonal scaled to one."""
    scale = _scale(matrix)
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale, rcond=1e-14, hermitian=True)
    return scale[:, None] * (inverse @ (scale[:, None] * right))


def _scale(matrix: Array) -> Array:
    return 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
