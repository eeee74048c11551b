"""Linear systems with unknowns of very different scales, and bounded steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools

REGULAR = 1e-9  # reciprocal condition from which an inverse is accurate enough
RELEASE_TOLERANCE = 1e-9  # share of the largest gradient below which a bound is not left


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
    scaled = matrix * scale[:, None] * scale
    try:
        np.linalg.cholesky(scaled)  # fails unless the matrix is positive definite
        inverse = np.linalg.inv(scaled)  # ten times faster than a pseudoinverse
        regular = np.linalg.norm(scaled, 1) * np.linalg.norm(inverse, 1) <= 1 / REGULAR
    except np.linalg.LinAlgError:
        regular, inverse = False, scaled
    inverse = 0.5 * (inverse + inverse.T) if regular else np.linalg.pinv(scaled, rcond, hermitian=True)
    return inverse * scale[:, None] * scale


def _scale(matrix: Array) -> Array:
    return 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds of the parameters, shape (P,) each."""

    lower: Array
    upper: Array

    def clip(self, x: Array) -> Array:
        return np.clip(x, self.lower, self.upper)

    def holding(self, x: Array, held: Bools) -> Bounds:
        """The same, with some parameters held at x, shape (P,)."""
        return Bounds(np.where(held, x, self.lower), np.where(held, x, self.upper))


def bounded_step(gradient: Array, hessian: Array, x: Array, bounds: Bounds) -> tuple[Array, Bools]:
    """Minimum of g·s + ½ s·H s with x + s within the bounds, and what is held at one, shape (P,) each.

    Primal active set: every step goes to the minimum over the free parameters or to the first bound in its
    way, and a bound whose gradient points inside is released, so that the quadratic never rises
    (Nocedal, Wright: Numerical Optimization, 2nd ed., section 16.5).
    """
    size = len(x)
    lower, upper = bounds.lower - x, bounds.upper - x
    scale = _scale(hessian)
    step = np.zeros(size)
    held = (upper - lower <= 0) | ((lower >= 0) & (gradient > 0)) | ((upper <= 0) & (gradient < 0))
    fixed = upper - lower <= 0
    for _ in range(4 * size):
        free = ~held
        slope = gradient + hessian @ step
        target = step.copy()
        target[free] += scaled_solve(hessian[np.ix_(free, free)], -slope[free])
        move = target - step
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(
                move > 0, (upper - step) / move, np.where(move < 0, (lower - step) / move, np.inf)
            )
        room[held] = np.inf
        first = int(np.argmin(room))
        if room[first] < 1.0:
            step = step + max(room[first], 0.0) * move
            step[first] = upper[first] if move[first] > 0 else lower[first]
            held[first] = True
            continue
        step = target
        slope = (gradient + hessian @ step) * scale
        inward = np.where(step <= lower, -slope, slope)  # positive: the quadratic falls away from the bound
        inward[~held | fixed] = -np.inf
        best = int(np.argmax(inward))
        if inward[best] <= RELEASE_TOLERANCE * (np.abs(gradient * scale).max() + 1e-300):
            break
        held[best] = False
    return np.clip(step, lower, upper), held
