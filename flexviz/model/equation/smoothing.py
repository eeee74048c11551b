"""Derivatives of a stretch of samples, all or below a frequency, up to its ends.

A filter would need what was before and after. For those below a frequency the sum of squared deviations and
of squared third differences is minimised (Whittaker, 1923; Eilers: A perfect smoother, Anal. Chem. 75, 2003):
a gain of 1/(1 + (ω/ω_c)⁶), and parabolas at the ends.
"""

from __future__ import annotations

import numpy as np

from flexviz.base._scipy import sp
from flexviz.base.arrays import Array

ORDER = 3  # of the differences
DEGREE = 5  # of the spline through the result: two derivatives


def derivatives_below(values: Array, step: float, cutoff: Array) -> Array:
    """Samples (N, m) below the frequencies (m,) [rad/s] and two derivatives, (3, N, m); `step` in s."""
    count = len(values)
    difference = np.diff(np.eye(ORDER + 1), ORDER, axis=0)[0]
    # Dᵀ D in the form of `solveh_banded`: the diagonals of its upper part, the main one last
    banded = np.zeros((ORDER + 1, count))
    for first in range(ORDER + 1):
        for second in range(first, ORDER + 1):
            columns = np.arange(second, count - ORDER + second)
            banded[ORDER - (second - first), columns] += difference[first] * difference[second]
    out = np.empty((3, *values.shape))
    for j, frequency in enumerate(cutoff):
        # (2 sin(ω h/2))⁶ is the gain of D³ᵀ D³
        weight = (2 * np.sin(min(0.5 * float(frequency) * step, 0.5 * np.pi))) ** (-2 * ORDER)
        matrix = weight * banded
        matrix[ORDER] += 1.0
        out[:, :, [j]] = derivatives(sp.linalg.solveh_banded(matrix, values[:, [j]]), step)
    return out


def derivatives(values: Array, step: float) -> Array:
    """Samples (N, m) and two derivatives of a spline through them, (3, N, m); `step` in s."""
    time = step * np.arange(len(values))
    curve = sp.interpolate.make_interp_spline(time, values, DEGREE)
    return np.stack([curve(time, k) for k in range(3)])
