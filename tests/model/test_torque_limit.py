"""Torque limit, as a law of a recorded command and as a plateau of the record."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent import cases, files
from independent.laws import Effect as TrueEffect
from independent.simulator import simulate

import flexviz
from flexviz.analysis.diagnosis.seen_limits import limit_findings
from flexviz.analysis.estimation.whitening import whitener
from flexviz.base.facts import Fact
from flexviz.checks import AllSamples, GroupSamples, saturated_joints, seen_limits
from flexviz.checks.masks.saturation import saturated as saturated_torques
from flexviz.data.measurements import MeasurementSet, Segment
from flexviz.model.effects import EFFECTS, EffectTarget
from flexviz.model.effects.torque_limit import SHARES, beyond
from flexviz.model.equation import build_signals
from flexviz.model.equation.saturated import bridged_torque
from flexviz.model.observers import ButterworthZeroPhase
from tests.model.test_effects import MOTION
from tests.planar_arm import planar_set

LAW, PLACE = EFFECTS["torque_limit"], EffectTarget(joint=0)
HOLD = 1e-3  # [s]


# -- the law of a command


def test_a_limit_of_zero_is_none_and_a_large_one_does_nothing() -> None:
    tau = np.array([-3.0, -1.0, 0.0, 2.0, 5.0])
    assert not beyond(tau, 0.0).any() and not beyond(tau, 5.0).any()
    np.testing.assert_array_equal(beyond(tau, 2.0), [[-1.0, 0.0, 0.0, 0.0, 3.0], [1.0, 0.0, 0.0, 0.0, -1.0]])


def test_guesses_are_limits_at_shares_of_the_largest_torque() -> None:
    largest, guesses = np.abs(MOTION.tau(0)[0]).max(), LAW.guesses(MOTION, PLACE)
    assert len(guesses) == len(SHARES)
    for share, guess in zip(SHARES, guesses, strict=True):
        whole = LAW.terms(MOTION, PLACE, np.array([share * largest])).value[0, :, 0]
        np.testing.assert_allclose(guess.columns[0, 0, :, 0], whole, atol=1e-9)
        np.testing.assert_allclose(guess.to_values(np.ones(1)), share * largest, rtol=5e-3)
        assert guess.to_values(np.zeros(1)) == pytest.approx(largest)
        assert guess.to_values(np.full(1, 1.5)) < guess.to_values(np.full(1, 0.5))


@pytest.fixture(scope="module")
def commanded(tmp_path_factory: pytest.TempPathFactory) -> tuple[MeasurementSet, float]:
    """A drive of the independent simulator that gives 70 % of the largest torque, and that limit [Nm]."""
    case = cases.draw(3, "none", "2r", hold=HOLD, duration=6.0)
    limit = 0.7 * float(np.abs(simulate(case.setup).tau[:, :, 1]).max())
    setup = replace(case.setup, effects=(TrueEffect("torque_limit", 1, {"limit": limit}),))
    record = simulate(setup).noisy(setup.noise, np.random.default_rng(1))
    folder = tmp_path_factory.mktemp("commanded") / "set"
    files.write(folder, setup, record, case.drawn, case.rough, case.own)
    return flexviz.read_set(folder), limit


def test_a_command_beyond_the_drives_limit_is_found_as_a_parameter(
    commanded: tuple[MeasurementSet, float],
) -> None:
    arm, limit = commanded
    assert seen_limits(arm) == ()  # the record shows the command
    name = arm.joints[1]
    found = flexviz.identify(arm, effects=[f"torque_limit:{name}"], refine=True)["torque_limit.limit", name]
    assert found.value == pytest.approx(limit, rel=2e-3) and found.identifiable == "yes"


@pytest.mark.slow
def test_the_diagnosis_names_it(commanded: tuple[MeasurementSet, float]) -> None:
    arm, limit = commanded
    result = flexviz.diagnose(arm, apply=True)
    (first,) = result.findings
    assert (result.verdict, first.effect, first.joint) == ("missing", "torque_limit", arm.joints[1])
    assert first.parameters["limit"].value == pytest.approx(limit, rel=0.02)


# -- the limit that a record shows


def swing(count: int = 4000, step: float = 1e-3, noise: float = 0.0) -> Segment:
    """Two joints that swing with the same period under torques of 10 and 4 Nm."""
    time = step * np.arange(count)
    rng = np.random.default_rng(2)
    theta = np.stack((np.sin(3 * time), np.cos(2 * time)), axis=1)
    tau = np.stack((10 * np.sin(3 * time + 0.2), 4 * np.sin(2 * time)), axis=1)
    return Segment(time, theta, tau + noise * rng.standard_normal(tau.shape), step)


def clipped(segment: Segment, joint: int, lower: float, upper: float, quantum: float = 0.0) -> Segment:
    tau = segment.tau.copy()
    tau[:, joint] = np.clip(tau[:, joint], lower, upper)
    if quantum:
        tau = quantum * np.round(tau / quantum)
    return replace(segment, tau=tau)


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("share", [0.6, 0.9])
def test_plateaus_are_seen(share: float, noise: float) -> None:
    (one,) = saturated_joints([clipped(swing(noise=noise), 0, -10 * share, 10 * share)])
    assert one.joint == 0 and one.limit == pytest.approx(10 * share)
    assert (one.lower, one.upper) == pytest.approx((-10 * share, 10 * share))
    assert one.rows > 500


def test_a_limit_on_one_side_and_two_that_differ() -> None:
    (high,) = saturated_joints([clipped(swing(), 1, -9.0, 3.0)])
    assert high.joint == 1 and high.upper == pytest.approx(3.0) and high.lower == -np.inf
    (both,) = saturated_joints([clipped(swing(), 0, -7.0, 8.0)])
    assert (both.lower, both.upper) == pytest.approx((-7.0, 8.0)) and 1900 <= both.rows < 2000
    values = {"lower": (None, -7.0), "upper": (3.0, 8.0), "tolerance": (0.0, 0.0), "rows": (80, 195)}
    assert Fact("torque-saturated", joints=("b", "a"), values=values).text == (
        "tau of b stands at its largest value (3.000 Nm) in 80 rows; tau of a stands at its largest / "
        "smallest value (8.000 and −7.000 Nm) in 195 rows: saturated; these rows are left out of fits"
    )


@pytest.mark.parametrize("quantum", [0.01, 0.1])
def test_a_coarse_record_has_plateaus_only_where_it_is_clipped(quantum: float) -> None:
    assert saturated_joints([clipped(swing(), 0, -99.0, 99.0, quantum)]) == ()
    (one,) = saturated_joints([clipped(swing(), 0, -8.0, 8.0, quantum)])
    assert one.limit == pytest.approx(8.0, abs=quantum)


def test_rest_and_held_values_are_no_limits() -> None:
    still, held = swing(), swing()
    still.tau[:1500], still.theta[:1500] = (10.5, 4.5), still.theta[1500]  # at rest under its largest torque
    held.tau[:] = held.tau[np.arange(len(held)) // 20 * 20]  # a drive twenty times slower than the log
    assert saturated_joints([still]) == () and saturated_joints([held]) == () and saturated_joints([]) == ()


def test_torque_beyond_a_limit_is_bridged() -> None:
    whole = swing()
    part = clipped(whole, 0, -8.0, 8.0)
    torque, unknown = bridged_torque(part.tau, saturated_joints([part]))
    assert unknown is not None and not unknown[:, 1].any()
    np.testing.assert_array_equal(unknown[:, 0], np.abs(whole.tau[:, 0]) >= 8.0)
    inside = slice(700, 3300)  # a plateau at an end of the record has one side only
    assert np.abs(torque - whole.tau)[inside].max() < 0.05
    assert bridged_torque(whole.tau, ())[1] is None


def test_an_import_names_it() -> None:
    one = clipped(swing(noise=0.01), 0, -7.0, 7.0)
    group = GroupSamples("g", (), one.time, one.theta, one.tau)
    (issue,) = saturated_torques(AllSamples(SimpleNamespace(joints="ab"), (group,)))  # type: ignore[arg-type]
    assert issue.kind == "saturated" and issue.severity == "odd" and issue.joints == ("a",)
    assert str(issue).startswith("tau of a: it stands at its largest / smallest value (±7.000 Nm) in ")


# -- fits without these samples


@pytest.fixture(scope="module")
def saturated(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """The planar arm with a record of joint 1 that stands at 45 Nm, as `flexviz simulate` makes it."""
    return planar_set(tmp_path_factory.mktemp("saturated") / "set", ["torque_limit:joint1:limit=45"], 3)


def test_the_simulated_record_is_seen_and_named(saturated: MeasurementSet) -> None:
    (one,) = seen_limits(saturated)
    assert one.joint == 0 and one.limit == pytest.approx(45.0, rel=1e-4)
    (found,) = limit_findings(saturated)
    assert found.text == "torque_limit:joint1" and found.confidence == 1.0
    assert found.parameters["limit"].value == pytest.approx(45.0, rel=1e-4)
    assert found.to_dict()["parameters"]["limit"]["unit"] == "Nm"


def test_its_samples_are_left_out_of_every_fit(saturated: MeasurementSet) -> None:
    signals = build_signals(saturated, saturated.groups, ButterworthZeroPhase(2 * np.pi * 7))
    share = signals.known.mean()
    assert 0.3 < share < 0.95
    for refine in (False, True):
        found = flexviz.identify(saturated, refine=refine)
        assert max(found.residual.rms) < 0.03
        assert found["stiffness", "joint1"].value == pytest.approx(1000.0, rel=0.02)
        assert found["motor_inertia", "joint2"].value == pytest.approx(1.55, rel=0.02)
    assert "tau of joint1 stands at its largest" in found.message and "saturated" in found.message


def test_unknown_samples_predict_no_others() -> None:
    """The whitened rest is that of the Cholesky factor of the known samples' covariance."""
    count, order = 30, 29
    lags = np.exp(-0.3 * np.arange(order + 1))
    covariance = np.tile(lags[:, None, None, None], (1, count, 1, 1))
    for lag in range(1, order + 1):
        covariance[lag, :lag] = 0.0  # nothing is before the first sample
    known = np.ones((count, 1), bool)
    known[10:14] = False
    y = np.random.default_rng(5).standard_normal((count, 1))
    white = whitener(covariance, 7, known=known).apply(y)
    rows = np.flatnonzero(known[:, 0])
    factor = np.linalg.cholesky(np.exp(-0.3 * np.abs(rows[:, None] - rows)))
    np.testing.assert_allclose(white[rows, 0], np.linalg.solve(factor, y[rows, 0]), atol=1e-8)
    assert not white[10:14].any()
    z = np.random.default_rng(6).standard_normal((count, 1, 2))
    both = whitener(covariance, known=known)
    np.testing.assert_allclose(
        np.einsum("ti,tip->p", both.apply(y), z), np.einsum("ti,tip->p", y, both.transposed(z)), atol=1e-9
    )
