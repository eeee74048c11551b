"""Small numerical methods of our own against those of SciPy, which take 20 to 40 MB to load."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.fft import next_fast_len
from scipy.interpolate import CubicSpline
from scipy.optimize import nnls

from flexviz.base.fourier import fast_length
from flexviz.base.nonnegative import nonnegative_least_squares
from flexviz.model.equation.splines import uniform_spline


def test_fast_length_is_that_of_scipy():
    for least in (*range(1, 5000), 2**20, 2**20 + 1, 999_983, 10**7 + 19):
        assert fast_length(least) == next_fast_len(least, real=True)
    assert fast_length(np.int64(7)) == 8


@pytest.mark.parametrize("count", [5, 6, 7, 200])
def test_uniform_spline_is_that_of_scipy(count):
    rng = np.random.default_rng(count)
    values, at = (
        rng.standard_normal(count),
        np.concatenate(([0.0, count - 1.0], rng.uniform(0, count - 1, 500))),
    )
    expected = CubicSpline(np.arange(count), values)
    for found, wanted in zip(uniform_spline(values, at), (expected(at), expected(at, 1)), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-11)


@pytest.mark.parametrize("kind", ["random", "positive", "dependent", "no larger than zero"])
def test_nonnegative_least_squares_against_scipy(kind):
    rng = np.random.default_rng(0)
    for _ in range(300):
        rows, size = rng.integers(1, 30), rng.integers(3, 14)
        a, b = rng.standard_normal((rows, size)), rng.standard_normal(rows)
        if kind == "positive":
            a = np.abs(a)
        if kind == "dependent":
            a[:, 0] = a[:, 1] + a[:, 2]
        if kind == "no larger than zero":
            a, b = np.abs(a), -np.abs(b)
        x, left = nonnegative_least_squares(a, b)
        assert (x >= 0).all()
        assert left == pytest.approx(np.linalg.norm(a @ x - b), abs=1e-12)
        assert left == pytest.approx(nnls(a, b)[1], abs=1e-11)
        _, from_some = nonnegative_least_squares(a, b, rng.random(size) < 0.5)
        assert from_some == pytest.approx(left, abs=1e-11)
        if kind == "no larger than zero":
            assert not x.any()


def test_nonnegative_least_squares_keeps_the_scale_of_its_columns():
    """Unknowns of very different units, as masses beside inertias of gears."""
    rng = np.random.default_rng(1)
    a, true = rng.standard_normal((40, 6)), np.array([0.0, 3.0, 0.0, 1.0, 2.0, 0.5])
    scale = 10.0 ** np.array([0, 3, -3, 2, -2, 1])
    x, left = nonnegative_least_squares(a * scale, a @ true)
    assert x * scale == pytest.approx(true, abs=1e-9)
    assert left == pytest.approx(0.0, abs=1e-9)


def test_identify_loads_no_more_of_scipy_than_it_uses():
    """Peak memory of the bundled example: 266 MB with scipy.fft and scipy.optimize, 237 MB without."""
    code = (
        "import re, sys\n"
        "from pathlib import Path\n"
        "from flexviz.outlets.terminal import main\n"
        "sys.argv = ['flexviz', 'identify', 'demo']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "parts = ('fft', 'optimize', 'interpolate', 'signal')\n"
        "loaded = [name for name in parts if f'scipy.{name}' in sys.modules]\n"
        # of this process alone: ru_maxrss is at least that of the one that has started it
        "peak = re.search(r'VmHWM:\\s+(\\d+)', Path('/proc/self/status').read_text())\n"
        "print(int(peak[1]) // 1024, *loaded)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300
    )
    peak, *loaded = done.stdout.splitlines()[-1].split()
    assert not loaded
    assert int(peak) < 255
