"""The criterion: J against brute force, correlation times, costs, accepted moves, what is unknown."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import huber as scipy_huber

from flexviz.analysis.diagnosis.coarse import Coarse
from flexviz.analysis.diagnosis.criterion import (
    Criterion,
    Gain,
    Score,
    correlation_times,
    criterion_of,
    gain,
)
from flexviz.analysis.diagnosis.fine import Fine
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.motion import MOTION, MotionContext, Residuals, deviations, huber
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout
from tests.planar_arm import HELD_OUT, planar_set
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
        parts.append(residuals_of(values, rng.random((count, n)) < 0.9))
    return parts


def clipped_deviation(values: Array, outlier: float) -> float:
    """Of single samples, shape (N,), those far off moved to where they begin to count linearly."""
    sigma = float(np.sqrt(np.mean(values**2)))
    for _ in range(0 if np.isinf(outlier) else 3):
        sigma = float(np.sqrt(np.mean(np.clip(values, -outlier * sigma, outlier * sigma) ** 2)))
    return sigma


@pytest.mark.parametrize("outlier", [np.inf, 2.5])
def test_the_score_is_that_of_every_single_sample(outlier: float) -> None:
    parts, least = two_parts(), np.array([1e-3, 0.5, 1e-3])
    criterion = criterion_of(parts, least, 30, outlier)
    found = criterion.score(parts, 7.0)
    expected, held, count = np.zeros(3), np.zeros(3), np.zeros(3)
    for j in range(3):
        each = [part.values[part.used[:, j], j] for part in parts]
        count[j] = sum(map(len, each))
        expected[j] = clipped_deviation(np.concatenate(each), outlier)
        held[j] = clipped_deviation(each[-1], outlier)
    np.testing.assert_allclose(found.deviation, expected, rtol=1e-12)
    np.testing.assert_allclose(found.held_out, held, rtol=1e-12)
    assert expected[1] < 0.5 and held[1] < 0.5  # below what noise and tolerance leave nothing counts
    samples = count / correlation_times(parts)
    np.testing.assert_allclose(criterion.samples, samples, rtol=1e-12)
    np.testing.assert_allclose(found.by_joint, samples * np.log(np.maximum(expected, least)), rtol=1e-12)
    np.testing.assert_allclose(found.held_out_by_joint, samples * np.log(np.maximum(held, least)), rtol=1e-12)
    assert found.cost == 7.0 and found.total == pytest.approx(found.by_joint.sum() + 7.0, rel=1e-12)


def test_samples_that_do_not_count_change_nothing() -> None:
    parts = two_parts(3)
    criterion = criterion_of(parts, np.full(3, 1e-3), 30, MOTION.outlier)
    spoilt = [residuals_of(np.where(p.used, p.values, 1e6), p.used) for p in parts]
    again = criterion_of(spoilt, np.full(3, 1e-3), 30, MOTION.outlier)
    np.testing.assert_allclose(again.samples, criterion.samples, rtol=1e-12)
    np.testing.assert_allclose(again.score(spoilt, 0.0).by_joint, criterion.score(parts, 0.0).by_joint)


def test_without_held_out_groups_the_fitted_ones_stand_for_them() -> None:
    part = two_parts()[0]
    found = criterion_of([part], np.full(3, 1e-3), 30).score([part], 0.0)
    np.testing.assert_array_equal(found.held_out, found.deviation)
    np.testing.assert_array_equal(found.held_out_by_joint, found.by_joint)


def test_j_falls_by_what_a_likelihood_of_unknown_variance_gains() -> None:
    """−log p = N log σ + N / 2, whose second term every model has; N independent samples count, not all."""
    rng = np.random.default_rng(1)
    values = 3.0 * rng.standard_normal((500, 1))
    part, half = residuals_of(values), residuals_of(0.5 * values)
    criterion = criterion_of([part], np.array([1e-9]), 1)
    found = gain(criterion.score([part], 0.0), criterion.score([half], 0.0))
    assert found.delta == pytest.approx(criterion.samples[0] * np.log(2))
    assert 0.75 * 500 < criterion.samples[0] < 500


def test_huber_is_scipys() -> None:
    ratio = np.abs(np.random.default_rng(0).standard_normal((200, 2))) * 3
    np.testing.assert_allclose(huber(ratio, 2.5), scipy_huber(2.5, ratio), rtol=1e-12)
    np.testing.assert_allclose(huber(ratio, np.inf), 0.5 * ratio**2, rtol=1e-12)


# -- independent samples


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlation_times_of_an_autoregressive_process(rho: float) -> None:
    rng = np.random.default_rng(2)
    values = np.concatenate([autoregressive(rng, 800, rho, 2) for _ in range(60)])
    part = residuals_of(values, block=800)
    lags = np.arange(1, 101)  # an eighth of a block
    expected = 1 + 2 * np.sum(rho ** (2 * lags))
    assert expected == pytest.approx((1 + rho**2) / (1 - rho**2))
    np.testing.assert_allclose(correlation_times([part]), expected, rtol=0.05)
    halves = [residuals_of(half, block=800) for half in np.split(values, 2)]
    np.testing.assert_allclose(correlation_times(halves), correlation_times([part]), rtol=1e-9)


def test_short_records_are_no_more_than_a_third_too_correlated() -> None:
    """The squares of what ρ_k scatters add up: few samples count a little less."""
    rng = np.random.default_rng(3)
    times = [correlation_times([residuals_of(rng.standard_normal((600, 2)))]) for _ in range(40)]
    assert 1 < np.mean(times) < 4 / 3


# -- costs


def priced(samples: float = 900.0, choices: int = 30) -> Criterion:
    return Criterion(np.array([samples / 3, 2 * samples / 3]), np.full(2, 1e-3), choices)


def test_costs_are_those_of_parameters_a_choice_and_a_place() -> None:
    criterion = priced()
    assert criterion.of_parameter == pytest.approx(0.5 * np.log(900))  # of all joints' samples
    assert criterion.of_effect == pytest.approx(np.log(30 / LIMITS.false_alarm))
    one = criterion.cost(2, 1)
    assert one == pytest.approx(np.log(900) + np.log(30 / 0.05))
    assert criterion.cost(3, 1, 5000) == pytest.approx(one + 0.5 * np.log(900) + np.log(5000))
    assert criterion.cost(4, 2) == pytest.approx(2 * one)  # costs of effects add up
    assert criterion.cost(1, 0) == criterion.of_parameter  # a stand-in is no effect of its own
    assert priced(choices=60).of_effect - criterion.of_effect == pytest.approx(np.log(2))


def test_a_move_that_changes_nothing_costs_its_parameters_and_its_choice() -> None:
    parts, criterion = two_parts(n=2), priced()
    before, after = (criterion.score(parts, criterion.cost(2 * k, k)) for k in (0, 1))
    cost = criterion.cost(2, 1)
    assert gain(before, after).delta == pytest.approx(-cost) and not gain(before, after).accepted
    assert gain(before, after).why == "it costs more than it gains"
    assert gain(after, before).delta == pytest.approx(cost) and gain(after, before).accepted  # it is saved
    same = gain(before, before)
    assert same.delta == 0.0 and not same.accepted and same.held_out == 0.0


# -- a number of a model


def adds_up(scores: list[Score], rng: np.random.Generator, triples: int) -> None:
    """J(A) − J(C) along every path, with the sign of its direction."""
    for _ in range(triples):
        a, b, c = (scores[k] for k in rng.integers(len(scores), size=3))
        whole, first, second = gain(a, c), gain(a, b), gain(b, c)
        size = abs(whole.delta) + abs(first.delta) + abs(second.delta)
        assert abs(whole.delta - first.delta - second.delta) <= 1e-6 * size
        np.testing.assert_allclose(whole.by_joint, first.by_joint + second.by_joint, atol=1e-6 * size + 1e-12)
        assert whole.held_out == pytest.approx(first.held_out + second.held_out, abs=1e-6 * size + 1e-12)
        assert gain(c, a).delta == -whole.delta and gain(c, a).held_out == -whole.held_out
        assert not (whole.accepted and gain(c, a).accepted)  # nobody walks to and fro


def test_j_adds_up_for_any_scores() -> None:
    rng, criterion = np.random.default_rng(7), priced()
    scores = [
        criterion.score(
            [residuals_of(rng.uniform(0.01, 10) * p.values) for p in two_parts(k, 2)],
            float(rng.uniform(0, 50)),
            rng.uniform(0.5, 2, 2),
        )
        for k in range(40)
    ]
    adds_up(scores, rng, 300)


MODELS = (
    (), ("coulomb_friction:0",), ("coulomb_friction:1",), ("torque_offset:0",),
    ("coulomb_friction:0", "torque_offset:0"), ("cable_spring:1", "torque_offset:1"), ("torque_gain:0",),
    ("coulomb_friction:0", "coulomb_friction:1", "quadratic_friction:1"),
)  # fmt: skip


def layouts(joints: tuple[str, ...]) -> list[Layout]:
    split = [[text.split(":") for text in texts] for texts in MODELS]
    return [Layout(joints, tuple(ChosenEffect(name, int(joint)) for name, joint in some)) for some in split]


@pytest.mark.parametrize("hidden", ["coulomb_friction:joint1:coulomb=1", "torque_offset:joint1:offset=1"])
def test_j_adds_up_for_fitted_models(hidden: str, tmp_path: Path) -> None:
    """200 random triples of models of two sets, and whatever is fitted, n_j stay those of the recording."""
    measurements = planar_set(tmp_path / "set", [hidden], 5, groups=HELD_OUT)
    own = Layout(measurements.joints)
    view = Coarse(MotionContext(measurements, own.joints, stand_ins=True), own, lambda _: None)
    criterion, samples = view.criterion, view.criterion.samples.copy()
    scores = [view.fit(layout, view.context.start(layout).x, 5).score for layout in layouts(own.joints)]
    adds_up(scores, np.random.default_rng(0), 100)
    assert view.criterion is criterion
    np.testing.assert_array_equal(criterion.samples, samples)
    order = sorted(scores, key=lambda score: score.total)
    assert all(gain(worse, better).delta >= 0 for better, worse in pairwise(order))


@pytest.mark.slow
def test_j_adds_up_in_units_of_the_noise(tmp_path: Path) -> None:
    measurements = planar_set(tmp_path / "set", ["coulomb_friction:joint1:coulomb=1"], 5, groups=HELD_OUT)
    own = Layout(measurements.joints)
    fine = Fine(FitContext(measurements, own), own, lambda _: None)
    start = fine.begin(own, fine.context.start(own).x, 3)
    models = [fine.fit(one, one.vector(own.model(start.fit.x)), 3) for one in layouts(own.joints)]
    adds_up([model.score for model in models], np.random.default_rng(0), 100)


# -- accepted moves


@pytest.mark.parametrize(("shift", "harmed"), [(1.0, True), (0.0, False)])
def test_a_model_that_harms_held_out_groups_is_refused(shift: float, harmed: bool) -> None:
    """A smaller one, too: what it saves is not what these groups lose."""
    rng = np.random.default_rng(7)
    fitted, held_out = rng.standard_normal((2000, 1)), rng.standard_normal((400, 1))
    criterion = Criterion(np.array([1000.0]), np.array([1e-3]), 30)
    before = [residuals_of(fitted + 1.0), residuals_of(held_out)]
    after = [residuals_of(fitted), residuals_of(held_out + shift)]
    for cost in (20.0, 10.0, 0.0):
        found = gain(criterion.score(before, 10.0), criterion.score(after, cost))
        assert found.delta > 50
        assert (found.held_out < np.log(LIMITS.false_alarm)) == harmed
        assert found.accepted == (not harmed)
        why = "" if found.accepted else "held-out groups are described less well"
        assert found.why == why


def test_how_much_worse_held_out_groups_may_be_described() -> None:
    chance = float(-np.log(LIMITS.false_alarm))
    for share, accepted in ((0.9, True), (1.1, False)):
        assert Gain(5.0, np.zeros(1), -share * chance).accepted == accepted


def test_j_has_to_fall_by_more_than_fits_are_converged_to() -> None:
    for share, accepted in ((-1.0, False), (0.0, False), (0.9, False), (1.1, True)):
        found = Gain(share * LIMITS.settled, np.zeros(1), 5.0)
        assert found.accepted == accepted
        assert found.why == ("" if accepted else "it costs more than it gains")


def test_a_model_is_judged_in_units_of_the_recorded_torque() -> None:
    """With all of a joint's torque 1 + g as large, its residual is, too: nothing is gained."""
    parts, least = two_parts(), np.full(3, 1e-3)
    criterion = criterion_of(parts, least, 30, MOTION.outlier)
    scale = np.array([0.2, 1.0, 1.5])
    shrunken = [Residuals(p.values * scale, p.used, p.blocks) for p in parts]
    found, plain = criterion.score(shrunken, 3.0, scale), criterion.score(parts, 3.0)
    np.testing.assert_allclose(found.deviation, plain.deviation, rtol=1e-12)
    np.testing.assert_allclose(found.held_out, plain.held_out, rtol=1e-12)
    assert gain(plain, found).delta == pytest.approx(0.0, abs=1e-9)
    assert gain(plain, criterion.score(shrunken, 3.0)).delta > 100  # what it would seem to gain


# -- what a model does not know


@pytest.mark.parametrize("share", [0.03, 0.1, 0.3])
@pytest.mark.parametrize("outlier", [np.inf, MOTION.outlier])
def test_the_deviation_is_recovered_from_samples_of_which_a_part_is_unknown(
    outlier: float, share: float
) -> None:
    """Samples of variance σ² + u² while a gap is crossed, σ² elsewhere."""
    rng = np.random.default_rng(4)
    sigma, count = np.array([0.3, 20.0]), 100_000
    crossed = rng.random((count, 2)) < share
    for times in (1.0, 3.0, 30.0):
        extra = np.where(crossed, times * sigma, 0.0) ** 2
        values = np.sqrt(sigma**2 + extra) * rng.standard_normal((count, 2))
        part = Residuals(values, np.ones((count, 2), bool), [slice(0, count)], extra)
        plain = replace(part, used=~crossed, unknown=None)  # as if these were not there
        found = deviations([part], outlier)
        np.testing.assert_allclose(found, deviations([plain], outlier), rtol=0.01)
        assert np.all(deviations([replace(part, unknown=None)], outlier) > 1.005 * found)


def test_a_variance_of_zero_is_none() -> None:
    part = two_parts()[0]
    known = replace(part, unknown=np.zeros_like(part.values))
    for outlier in (np.inf, 2.5):
        np.testing.assert_allclose(deviations([known], outlier), deviations([part], outlier), rtol=1e-12)


def test_what_is_unknown_has_its_price() -> None:
    """J is n times half the mean of log(σ² + u), of samples whose variance is σ² + u."""
    rng = np.random.default_rng(6)
    sigma, count = np.array([0.3, 20.0]), 50_000
    extra = np.where(rng.random((count, 2)) < 0.2, 10.0 * sigma, 0.0) ** 2
    values = np.sqrt(sigma**2 + extra) * rng.standard_normal((count, 2))
    part = Residuals(values, np.ones((count, 2), bool), [slice(0, count)], extra)
    criterion = Criterion(np.array([100.0, 200.0]), np.full(2, 1e-3), 30)
    found = criterion.score([part], 0.0)
    expected = criterion.samples * 0.5 * np.mean(np.log(sigma**2 + extra), axis=0)
    np.testing.assert_allclose(found.by_joint, expected, atol=0.02 * 200)
    np.testing.assert_allclose(found.held_out_by_joint, found.by_joint)
    everything = replace(part, unknown=np.full((count, 2), 1e6) * sigma**2)  # explains all, and nothing
    assert criterion.score([everything], 0.0).total > found.total + 100


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_torque_that_a_limit_cuts_off_counts_as_if_nothing_described_it(share: float) -> None:
    """A share of the samples with the torque's own deviation, the others with what is left of them."""
    rng = np.random.default_rng(5)
    torque = [residuals_of(np.array([3.0, 50.0]) * rng.standard_normal((500, 2))) for _ in range(2)]
    criterion = Criterion(np.array([200.0, 300.0]), np.full(2, 1e-3), 30)
    left = [replace(part, values=0.01 * part.values) for part in torque]
    bare, rest = criterion.score(torque, 0.0), criterion.score(left, 0.0)
    found = criterion.score(left, 0.0, cut=(np.full(2, share), bare.deviation))
    for name in ("by_joint", "held_out_by_joint"):
        expected = share * bare.by_joint + (1 - share) * getattr(rest, name)
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-12)
    assert gain(bare, found).delta == pytest.approx(
        (1 - share) * 500 * np.log(100)
    )  # of a limit of zero none
