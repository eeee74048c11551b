"""Least squares whose unknowns are not negative."""

from __future__ import annotations

import numpy as np

from flexviz.base.arrays import Array, Bools

STEPS = 3  # times the number of unknowns: steps before it gives up


def nonnegative_least_squares(a: Array, b: Array, begin: Bools | None = None) -> tuple[Array, float]:
    """x ≥ 0 of least |A x − b|, and this norm, for A of shape (M, P) and b of shape (M,).

    `begin` (P,): unknowns that are probably positive; default: all.

    An unknown is freed as long as that lowers the norm; a step to the least squares of the free ones ends at
    the first that reaches zero (Lawson, Hanson: Solving Least Squares Problems, 1974, chapter 23). It starts
    with those free that are positive without bounds, which are mostly right. As `scipy.optimize.nnls`, which
    would load 24 MB for it.
    """
    size = a.shape[1]
    x, in_vain = np.zeros(size), np.zeros(size, bool)
    free = np.ones(size, bool) if begin is None else begin.copy()
    while free.any() and not ((x := _of_free(a, b, free))[free] > 0.0).all():
        free &= x > 0.0
        x = np.zeros(size)
    tolerance = 10 * max(a.shape) * np.finfo(float).eps * float(np.abs(a).sum(axis=0).max(initial=0.0))
    left = b - a @ x
    for _ in range(STEPS * size):
        fall = np.where(free | in_vain, -np.inf, a.T @ left)  # of half the square, per unit of an unknown
        at = int(np.argmax(fall))
        if fall[at] <= tolerance:
            break
        free[at] = True
        target = _of_free(a, b, free)
        if target[at] <= 0.0:  # by rounding: it depends on the others
            free[at], in_vain[at] = False, True
            continue
        in_vain[:] = False
        while (stopped := free & (target <= 0.0)).any():
            x += np.min(x[stopped] / (x[stopped] - target[stopped])) * (target - x)
            free &= x > tolerance
            x[~free] = 0.0
            target = _of_free(a, b, free)
        x = target
        left = b - a @ x
    return x, float(np.linalg.norm(left))


def _of_free(a: Array, b: Array, free: Bools) -> Array:
    out = np.zeros(len(free))
    out[free] = np.linalg.lstsq(a[:, free], b)[0]
    return out
