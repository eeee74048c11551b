"""Cubic splines of uniform samples."""

from __future__ import annotations

import numpy as np

from flexviz.base._scipy import sp
from flexviz.base.arrays import Array


def uniform_spline(values: Array, at: Array) -> tuple[Array, Array]:
    """The spline through samples (N,), N ≥ 5, at places (M,) in samples, and its slope per sample.

    In each interval cubic, with continuous second derivatives m: m₋ + 4 m + m₊ = 6 Δ²y, and "not a knot" next
    to the ends. As `scipy.interpolate.CubicSpline`, which would load 25 MB for it.
    """
    bend = np.diff(values, 2)
    right = 6.0 * bend
    right[[0, -1]] = bend[[0, -1]]  # not a knot: m at the first and the last place but one
    right[1] -= right[0]
    right[-2] -= right[-1]
    matrix = np.ones((2, len(bend)))
    matrix[1, 1:-1] = 4.0
    matrix[0, [1, -1]] = 0.0
    second = np.empty(len(values))
    second[1:-1] = sp.linalg.solveh_banded(matrix, right)
    second[0], second[-1] = 2 * second[1] - second[2], 2 * second[-2] - second[-3]
    start = np.clip(at.astype(int), 0, len(values) - 2)
    b = at - start
    a = 1.0 - b
    (y0, y1), (m0, m1) = ((v[start], v[start + 1]) for v in (values, second))
    found = a * y0 + b * y1 - a * b / 6.0 * ((1.0 + a) * m0 + (1.0 + b) * m1)
    return found, y1 - y0 + ((1.0 - 3.0 * a**2) * m0 - (1.0 - 3.0 * b**2) * m1) / 6.0
