"""Small numerical helpers against SciPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.fft
from scipy.interpolate import CubicSpline

from flexviz.effects.free_curve import NODES, _cardinal
from flexviz.fourier import quick_length


def test_quick_lengths_are_those_of_scipy() -> None:
    counts = [*range(1, 3000), 123_457, 999_983, 7_200_001]
    assert [quick_length(n) for n in counts] == [scipy.fft.next_fast_len(n, real=True) for n in counts]
    number: Any = np.int64(1021)  # has no bit_length
    assert quick_length(number) == 1024


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_splines_of_a_free_curve_are_those_of_scipy(order: int) -> None:
    spline = CubicSpline(np.arange(NODES), np.eye(NODES), bc_type="natural")
    place = np.r_[0.0, np.random.default_rng(0).uniform(0, NODES - 1, 200), NODES - 1.0]
    assert _cardinal(place, order) == pytest.approx(spline(place, order), abs=1e-13)
