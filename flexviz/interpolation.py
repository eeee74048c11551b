"""Cubic splines between fixed instants, for thousands of records on the same grid.

`scipy.interpolate.CubicSpline` forms and solves its equations anew for every record; here they are factored
once, and a record costs one substitution.
"""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array

COUPLED = 1e-17  # coupling of two unknowns, about the pivot, that changes nothing


class TridiagonalSystem:
    """Linear equations between neighbouring unknowns, reduced once for many right-hand sides.

    Parallel cyclic reduction: every sweep doubles the distance of the unknowns that an equation couples, and
    squares how strongly it does; those of a spline need five, of whatever length (Hockney, Jesshope: Parallel
    Computers 2, 1988, section 5.4). For equations whose middle terms prevail: no pivots are sought. SciPy's
    linear algebra would take a quarter of a second to load.

    Args:
        below: shape (N − 1,), factor of the unknown before, from the second equation on.
        middle: shape (N,), of the equation's own unknown.
        above: shape (N − 1,), of the unknown after, up to the last equation but one.
    """

    def __init__(self, below: Array, middle: Array, above: Array) -> None:
        self._sweeps: list[tuple[Array, Array]] = []
        distance = 1
        while distance < len(middle):
            down, up = below / middle[:-distance], above / middle[distance:]
            if max(np.abs(down).max(), np.abs(up).max()) < COUPLED:
                break
            self._sweeps.append((down, up))
            middle = middle.copy()
            middle[distance:] -= down * above
            middle[:-distance] -= up * below
            left = max(len(middle) - 2 * distance, 0)
            below, above = -down[distance:] * below[:left], -up[:left] * above[distance:]
            distance *= 2
        self._middle = middle

    def solve(self, right: Array) -> Array:
        """The unknowns, shape (N,), for a right-hand side (N,)."""
        for down, up in self._sweeps:
            distance = len(right) - len(down)
            reduced = right.copy()
            reduced[distance:] -= down * right[:-distance]
            reduced[:-distance] -= up * right[distance:]
            right = reduced
        return right / self._middle


class CubicInterpolation:
    """The cubic spline through samples of a record, read at other instants.

    Not-a-knot at both ends (de Boor, A Practical Guide to Splines, chapter IV).

    Args:
        time: shape (N,), increasing, of the samples; at least four.
        at: shape (M,), where the spline is read.
    """

    def __init__(self, time: Array, at: Array) -> None:
        self._step = step = np.diff(time)
        ends = step[0] + step[1], step[-1] + step[-2]
        middle = np.r_[step[1], 2 * (step[:-1] + step[1:]), step[-2]]
        below, above = np.r_[step[1:], ends[1]], np.r_[ends[0], step[:-1]]
        self._equations = TridiagonalSystem(below, middle, above)
        self._before = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(step) - 1)
        h = step[self._before]
        u = (at - time[self._before]) / h
        # of the second of two neighbouring values, and of the slopes at both
        self._values = u * u * (3 - 2 * u), u * (1 - u) ** 2 * h, u * u * (u - 1) * h
        self._rates = 6 * u * (1 - u) / h, (1 - u) * (1 - 3 * u), u * (3 * u - 2)

    def slopes(self, y: Array) -> Array:
        """Derivative of the spline at the samples, shape (N,), from their values (N,)."""
        step, rise = self._step, np.diff(y) / self._step
        right = np.empty(len(y))
        right[1:-1] = 3 * (step[1:] * rise[:-1] + step[:-1] * rise[1:])
        for end, (h, k), (r, s) in ((0, step[:2], rise[:2]), (-1, step[:-3:-1], rise[:-3:-1])):
            both = h + k
            right[end] = ((h + 2 * both) * k * r + h * h * s) / both
        return self._equations.solve(right)

    def read(self, y: Array) -> tuple[Array, Array]:
        """Values and derivatives of the spline through y (N,), shape (M,) each."""
        slopes, i = self.slopes(y), self._before
        rise, here, there = np.diff(y)[i], slopes[i], slopes[i + 1]
        (a, b, c), (d, e, f) = self._values, self._rates
        return y[i] + a * rise + b * here + c * there, d * rise + e * here + f * there
