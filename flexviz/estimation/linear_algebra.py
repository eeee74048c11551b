"""Linear systems with unknowns of very different scales, and bounded steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def scaled_solve(matrix: Array, right: Array) -> Array:
    """Solve a symmetric positive system with its diagonal scaled to one; least squares if singular."""
    scale = _scale(matrix)
    scaled = matrix * scale[:, None] * scale
    try:
        return scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:
        return scale * np.linalg.lstsq(scaled, scale * right, rcond=1e-12)[0]


def scaled_inverse(matrix: Array, rcond: float = 1e-14) -> Array:
    """Pseudoinverse of a symmetric matrix via a unit diagonal; `rcond` as in `numpy.linalg.pinv`."""
    scale = _scale(matrix)
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale, rcond=rcond, hermitian=True)
    return inverse * scale[:, None] * scale


def least_norm_solve(matrix: Array, right: Array) -> Array:
    """Solve a symmetric system for right-hand sides (P, K) by pseudoinverse with a unit diagonal."""
    scale = _scale(matrix)
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale, rcond=1e-14, hermitian=True)
    return scale[:, None] * (inverse @ (scale[:, None] * right))


def _scale(matrix: Array) -> Array:
    return 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds of the parameters, shape (P,) each."""

    lower: Array
    upper: Array

    def clip(self, x: Array) -> Array:
        return np.clip(x, self.lower, self.upper)


def bounded_step(
    gradient: Array, hessian: Array, x: Array, bounds: Bounds
) -> tuple[Array, NDArray[np.bool_]]:
    """Gauss–Newton step within the bounds, and which parameters it holds at a bound, shape (P,) each."""
    fixed = np.zeros(len(x), bool)
    step = np.zeros(len(x))
    for _ in range(len(x)):
        free = ~fixed
        right = -gradient[free] - hessian[np.ix_(free, fixed)] @ step[fixed]
        step[free] = scaled_solve(hessian[np.ix_(free, free)], right)
        crossing = free & ((x + step < bounds.lower) | (x + step > bounds.upper))
        if not crossing.any():
            break
        step[crossing] = bounds.clip(x + step)[crossing] - x[crossing]
        fixed |= crossing
    return step, fixed
