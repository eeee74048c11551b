"""The criterion: likelihoods against brute force, correlation times, and the standard error of a gain."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import huber

from flexviz.diagnosis.criterion import (
    Gain,
    Likelihood,
    Residuals,
    confidence,
    correlation_times,
    gain,
    half_seconds,
    likelihood,
)
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import build_signals
from flexviz.measurements import MeasurementSet
from flexviz.observers import FlatZeroPhase
from tests.toy_regression import autoregressive, residuals_of

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.criterion


def two_parts(seed: int = 0, n: int = 3) -> list[Residuals]:
    """Fit and held-out residuals of n joints, a tenth of them not used, some far off."""
    rng = np.random.default_rng(seed)
    parts = []
    for count in (400, 150):
        values = rng.standard_normal((count, n)) * np.array([1.0, 0.1, 20.0][:n])
        values[rng.random((count, n)) < 0.03] *= 12
        parts.append(residuals_of(values, 25, rng.random((count, n)) < 0.9))
    return parts


@pytest.mark.parametrize("outlier", [np.inf, 2.5])
def test_the_likelihood_is_that_of_every_single_sample(outlier: float) -> None:
    parts, floor = two_parts(), np.array([1e-3, 0.5, 1e-3])
    found = likelihood(parts, floor, 7.0, 4, outlier)
    losses, count = [], np.zeros(3)
    for j in range(3):
        kept = np.concatenate([part.values[part.used[:, j], j] for part in parts])
        count[j] = len(kept)
        sigma = np.sqrt(np.mean(kept**2))
        for _ in range(0 if np.isinf(outlier) else 3):
            sigma = np.sqrt(np.mean(np.minimum(np.abs(kept), outlier * sigma) ** 2))
        sigma = max(sigma, floor[j])
        assert found.deviation[j] == pytest.approx(sigma, rel=1e-12)
        each = []
        for part in parts:
            for rows in part.stretches:
                here = part.values[rows, j][part.used[rows, j]]
                each.append(np.sum(huber(outlier, here / sigma) + np.log(sigma)))
        losses.append(each)
    np.testing.assert_allclose(found.losses, np.transpose(losses), rtol=1e-12)
    assert found.deviation[1] == 0.5  # no less than what noise explains
    assert found.held_out.tolist() == [False] * 16 + [True] * 6
    assert (found.other, found.freedom) == (7.0, 4)
    assert found.samples == pytest.approx(np.sum(count / found.times))


def test_a_gaussian_likelihood_with_its_own_variance_is_that_of_the_variance_alone() -> None:
    """−log p = N log σ + N / 2 (and N log 2π / 2, which every model has)."""
    values = 3.0 * np.random.default_rng(1).standard_normal((500, 1))
    found = likelihood([residuals_of(values, 50)], np.zeros(1), 0.0, 0)
    sigma = np.sqrt(np.mean(values**2))
    assert found.losses.sum() == pytest.approx(500 * (np.log(sigma) + 0.5))


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlation_times_of_an_autoregressive_process(rho: float) -> None:
    rng = np.random.default_rng(2)
    values = np.concatenate([autoregressive(rng, 800, rho, 2) for _ in range(60)])
    part = residuals_of(values, 100, block=800)
    lags = np.arange(1, 101)  # an eighth of a block
    expected = 1 + 2 * np.sum(rho ** (2 * lags))
    assert expected == pytest.approx((1 + rho**2) / (1 - rho**2))
    np.testing.assert_allclose(correlation_times([part]), expected, rtol=0.05)
    halves = [residuals_of(half, 100, block=800) for half in np.split(values, 2)]
    np.testing.assert_allclose(correlation_times(halves), correlation_times([part]), rtol=1e-9)


def test_short_records_are_no_more_than_a_third_too_correlated() -> None:
    """The squares of what ρ_k scatters add up: few samples count a little less."""
    rng = np.random.default_rng(3)
    times = [correlation_times([residuals_of(rng.standard_normal((600, 2)), 50)]) for _ in range(40)]
    assert 1 < np.mean(times) < 4 / 3


def compared(rng: np.random.Generator, rho: float, size: float) -> Gain:
    """What a model gains that describes a sine beside autocorrelated noise of two joints."""
    count, block = 3000, 1000
    noise = np.concatenate([autoregressive(rng, block, rho, 2) for _ in range(count // block)])
    sine = size * np.sin(2 * np.pi * np.arange(count) / 25)[:, None] * np.array([1.0, 0.0])
    after, before = (residuals_of(values, 50, block=block) for values in (noise, noise + sine))
    floor = np.full(2, 1.05)
    times = correlation_times([after])
    worse, better = (likelihood([part], floor, 0.0, 0, times=times) for part in (before, after))
    return gain(worse, better)


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "size"), [(0.0, 0.2), (0.0, 1.0), (0.7, 0.3)])
def test_the_standard_error_is_the_scatter_of_repetitions_or_a_little_more(rho: float, size: float) -> None:
    rng = np.random.default_rng(4)
    found = [compared(rng, rho, size) for _ in range(300)]
    scatter = np.std([one.delta for one in found], ddof=1)
    assert 0.9 < np.mean([one.error for one in found]) / scatter < 1.5
    by_joint = np.std([one.by_joint[0] for one in found], ddof=1)
    assert 0.9 < np.mean([one.errors[0] for one in found]) / by_joint < 1.5
    assert found[0].delta == pytest.approx(found[0].by_joint.sum())  # neither parameters nor candidates


def of(values: Array, freedom: int = 0, other: float = 0.0, held_out: Array | None = None) -> Likelihood:
    """Likelihood of residuals of known variance 1."""
    parts = [residuals_of(part, 50) for part in ([values] if held_out is None else [values, held_out])]
    return likelihood(parts, np.ones(values.shape[1]), other, freedom, times=np.ones(values.shape[1]))


def test_a_move_that_changes_nothing_costs_its_parameters_and_its_choice() -> None:
    values = 0.5 * np.random.default_rng(5).standard_normal((1000, 1))
    before, after = of(values), of(values, freedom=2)
    cost = 2 * np.log(20) + np.log(1000)
    assert gain(before, after, 20).delta == pytest.approx(-cost)
    assert gain(after, before, 20).delta == pytest.approx(cost)  # and is saved
    assert gain(before, before, 20).delta == 0.0  # a swap of laws with as many parameters
    assert gain(before, of(values, other=3.0)).delta == pytest.approx(-3.0)
    assert gain(before, after).why == "it costs more than it gains"


def test_what_happens_once_is_judged_by_the_noise_alone_where_that_is_all_that_is_left() -> None:
    """No other stretch confirms a contact: the scatter between stretches is as large as what it gains."""
    rng = np.random.default_rng(6)
    noise = rng.standard_normal((1000, 1))
    pushed = noise.copy()
    pushed[500:550] += 1.5
    found = gain(of(pushed), of(noise))
    assert found.accepted and not found.reversed.accepted
    by_noise = np.sqrt(2 * found.by_joint.sum())
    assert found.error == pytest.approx(by_noise, rel=0.2)
    error = np.sqrt(2) * noise  # half of the variance is a model error
    unsure = gain(of(error + pushed - noise), of(error))
    assert unsure.delta > 2 and not unsure.accepted and unsure.why == "what it gains may be chance"


def test_a_move_that_harms_held_out_groups_is_refused() -> None:
    rng = np.random.default_rng(7)
    fitted, held_out = rng.standard_normal((2000, 1)), rng.standard_normal((400, 1))
    before = of(fitted + 1.0, held_out=held_out)
    for shift, harmed in ((1.0, True), (0.01, False)):
        found = gain(before, of(fitted, held_out=held_out + shift))
        assert found.delta > LIMITS.deviations * found.error
        assert found.harmed == harmed and found.accepted == (not harmed)
        assert bool(found.why) == harmed
    assert found.reversed.delta == -found.delta and not found.reversed.accepted


def test_two_stretches_say_nothing_about_chance() -> None:
    values = np.random.default_rng(8).standard_normal((100, 1))
    found = gain(of(values + 2.0), of(values))
    assert found.delta > 50 and found.error == np.inf and not found.accepted


def test_stretches_are_about_half_a_second(demo: MeasurementSet) -> None:
    signals = build_signals(demo, demo.groups, FlatZeroPhase(2 * np.pi * 6))
    stretches = half_seconds(signals.blocks)
    assert stretches[0].start == 0 and stretches[-1].stop == signals.count
    assert all(a.stop == b.start for a, b in pairwise(stretches))
    edges = {s.start for s in stretches}
    assert {block.rows.start for block in signals.blocks} <= edges  # none reaches over a gap
    seconds = [np.ptp(signals.time[s]) for s in stretches]
    assert 0.4 < np.median(seconds) < 0.6


def test_confidence_follows_what_a_finding_gains() -> None:
    one = Gain(100.0, 5.0, np.zeros(1), np.zeros(1))
    sure = confidence(one, 0.0)
    assert confidence(replace(one, delta=20.0), 0.0) < sure > 0.95
    assert confidence(replace(one, error=45.0), 0.0) < sure
    assert 0.85 < confidence(one, 100.0) < sure  # what gains as much beside it may be imitated ...
    assert confidence(one, 1000.0) < 0.6  # ... and what gains much more, probably
    assert confidence(replace(one, delta=LIMITS.deviations * 5.0 + LIMITS.temperature), 0.0) == pytest.approx(
        0.73, abs=0.01
    )
    assert confidence(replace(one, delta=-1e6), 0.0) < 1e-9
