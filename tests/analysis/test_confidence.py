"""The confidence of a finding: what it gains, what is left beside it, and its rivals."""

from __future__ import annotations

import numpy as np
import pytest

from flexviz.analysis.diagnosis.criterion import Criterion, confidence, gain, split, unexplained
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from tests.toy_regression import residuals_of

LIMITS = THRESHOLDS.criterion


def test_confidence_grows_with_what_is_gained_and_falls_with_what_is_left() -> None:
    gains, rest = np.linspace(-200, 500, 80), np.array([0.0, 3.0, 30.0, 300.0, 3000.0])
    table = np.array([[confidence(float(g), float(left)) for g in gains] for left in rest])
    assert np.all(np.diff(table, axis=1) >= 0) and np.all(np.diff(table, axis=0) <= 0)
    assert np.all((table > 0) & (table < 1))
    some = np.array([confidence(g, 0.0) for g in (-10.0, 0.0, 5.0, 10.0, 20.0)])
    assert np.all(np.diff(some) > 0.005)


def test_confidence_of_some_gains() -> None:
    """One to the odds of all that speaks against it: nothing there, an imitation, an error of any kind."""
    for gained, left in ((0.0, 0.0), (LIMITS.temperature, 0.0), (7.0, 0.5), (20.0, 12.0), (1e4, 0.0)):
        against = np.exp(-gained / LIMITS.temperature) + LIMITS.doubt * left + LIMITS.least_doubt
        assert confidence(gained, left) == pytest.approx(1 / (1 + against))
    assert confidence(LIMITS.temperature, 0.0) == pytest.approx(0.73, abs=0.01)
    assert confidence(1e9, 0.0) == pytest.approx(1 / (1 + LIMITS.least_doubt))
    assert confidence(-1e6, 0.0) < 1e-9
    # an unmodelled torque as large as what it removes may imitate it, and one ten times as strong does
    assert confidence(1e4, 1.0) > 0.9 > 0.5 > confidence(1e4, 10.0)


def test_what_is_left_unexplained_is_relative_to_what_an_effect_removes() -> None:
    """σ² = left + removed before, left after: n log σ falls by ½ n log(1 + removed / left)."""
    samples = np.array([300.0, 50.0])
    criterion = Criterion(samples, np.full(2, 1e-6), 30)
    rng = np.random.default_rng(0)
    values = rng.standard_normal((400, 2))
    for left in (0.02, 1.0, 30.0):
        rest, whole = np.sqrt(left) * values, np.sqrt(1.0 + left) * values
        whole[:, 1] = rest[:, 1]  # it acts on joint 0 alone
        need = gain(criterion.score([residuals_of(whole)], 0.0), criterion.score([residuals_of(rest)], 8.0))
        for joint in (0, None):  # of no joint: where it gains most
            assert unexplained(need, samples, joint) == pytest.approx(left)
        assert unexplained(need, samples, 1) > 1e6  # it removes nothing there


def test_a_familys_confidence_is_divided_by_what_its_rivals_gain() -> None:
    assert split(0.9, []) == 0.9
    assert split(0.9, [0.0]) == pytest.approx(0.45)  # as good: a half each
    assert split(0.9, [-np.log(4.0), -np.log(4.0)]) == pytest.approx(0.6)
    assert split(0.9, [-1e4]) == pytest.approx(0.9) and split(0.9, [1e4]) == pytest.approx(0.45)
