"""The spline between fixed instants is SciPy's, which does the same for one record at a time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

from flexviz.interpolation import CubicInterpolation, TridiagonalSystem


@pytest.mark.parametrize("count", [4, 5, 300])
@pytest.mark.parametrize("even", [True, False])
def test_values_and_rates(count: int, even: bool) -> None:
    random = np.random.default_rng(count)
    time = 3.0 + np.cumsum(np.full(count, 0.01) if even else random.uniform(0.005, 0.02, count))
    at = np.r_[time[0] - 1e-3, np.linspace(time[0], time[-1], 7 * count), time, time[-1] + 1e-3]
    record = random.normal(size=count)
    value, rate = CubicInterpolation(time, at).read(record)
    expected = CubicSpline(time, record)
    assert np.allclose(value, expected(at), rtol=0, atol=1e-12)
    assert np.allclose(rate, expected(at, 1), rtol=0, atol=1e-9)


def test_a_cubic_is_met_exactly() -> None:
    time = np.array([0.0, 0.3, 0.5, 1.2, 1.4])
    at = np.linspace(0, 1.4, 50)
    value, rate = CubicInterpolation(time, at).read(2 - time + 3 * time**3)
    assert np.allclose(value, 2 - at + 3 * at**3) and np.allclose(rate, 9 * at**2 - 1)


@pytest.mark.parametrize("count", [2, 3, 7, 400])
def test_neighbouring_unknowns_are_solved_as_by_elimination(count: int) -> None:
    rng = np.random.default_rng(count)
    below, above = rng.uniform(0.1, 1.0, (2, count - 1))
    middle, right = rng.uniform(2.0, 3.0, count), rng.normal(size=count)
    bands = np.array([np.r_[0.0, above], middle, np.r_[below, 0.0]])
    found = TridiagonalSystem(below, middle, above).solve(right)
    np.testing.assert_allclose(found, solve_banded((1, 1), bands, right), rtol=1e-13, atol=1e-13)
