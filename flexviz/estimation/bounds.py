"""Limits of the parameters, and the step that keeps them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.linear_algebra import scaled_solve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bounds:
    """Limits of each parameter, shape (P,) each."""

    lower: Array
    upper: Array

    def clip(self, x: Array) -> Array:
        return np.clip(x, self.lower, self.upper)


def bounded_step(
    gradient: Array, hessian: Array, x: Array, bounds: Bounds
) -> tuple[Array, NDArray[np.bool_]]:
    """The Gauss–Newton step with parameters that would cross a bound put onto it; and which those are."""
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
