"""Static tests: holds found, pushes against a clamp and weights in the fit, designed and imported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.static_stiffness import add_pushes, make_case, outcome
from flexviz import identify, read_set
from flexviz.analysis.designing import design_static, static_fact, subject_of, write_static
from flexviz.analysis.estimation.holds import HoldsTerm, clamped_compliances, free_holds
from flexviz.base.errors import InputError
from flexviz.data.measurements import HoldGroup, Holds, MeasurementSet, find_holds
from flexviz.model.equation import LinkDynamics, layout_of
from flexviz.robot.robot import PayloadBody

STIFFNESS, FRICTION, LOADED = 2000.0, 1.5, 0.05


def pushes(levels: np.ndarray, noise: float = 0.0, seed: int = 0) -> HoldGroup:
    """Pushes of one joint that always slid: θ = q + s/K, s = τ − d (F + μ |s|)."""
    way = np.sign(np.diff(levels, prepend=levels[0] - 1.0))
    left = levels - way * FRICTION
    load = left / (1 + way * LOADED * np.sign(left))
    rng = np.random.default_rng(seed)
    theta = 0.3 + load / STIFFNESS + noise * rng.standard_normal(len(levels))
    holds = Holds(np.arange(len(levels)), theta[:, None], levels[:, None], way[:, None])
    return HoldGroup("g", "p", (), Path("g.csv"), holds, np.array([True]))


LOOP = np.concatenate([np.linspace(-20, 20, 9), np.linspace(20, -20, 9)[1:], np.linspace(-20, 20, 9)[1:]])


def test_the_slope_of_the_pushes_is_the_compliance_whatever_the_friction() -> None:
    found = clamped_compliances([pushes(LOOP)], 1)
    assert 1 / found.value[0] == pytest.approx(STIFFNESS, rel=1e-6)
    one_way = clamped_compliances([pushes(np.linspace(5, 20, 3))], 1)
    assert one_way.precision[0] == 0.0  # too few to tell


def test_intervals_of_pushes_cover() -> None:
    inside = 0
    for seed in range(200):
        found = clamped_compliances([pushes(LOOP, 2e-4, seed)], 1)
        inside += abs(found.value[0] - 1 / STIFFNESS) * np.sqrt(found.precision[0]) < 1.96
    assert 180 <= inside <= 198


def test_a_push_that_does_not_move_the_motor_says_nothing() -> None:
    group = pushes(LOOP)
    stuck = group.holds.tau.copy()
    theta, way = group.holds.theta.copy(), group.holds.approach.copy()
    theta[5], way[5] = theta[4], 0.0  # within the dead band
    stuck[5] = stuck[4] + 0.8
    moved = replace(group, holds=Holds(group.holds.time, theta, stuck, way))
    found = clamped_compliances([moved], 1)
    assert 1 / found.value[0] == pytest.approx(STIFFNESS, rel=1e-6)


def test_holds_are_the_rests_of_a_recording() -> None:
    time = np.arange(0, 8.0, 0.01)
    place = np.interp(time, [0, 1, 1.5, 3, 3.5, 5, 5.5, 8], [0, 0, 1e-2, 1e-2, 3e-2, 3e-2, 2e-2, 2e-2])
    rng = np.random.default_rng(0)
    theta = (place + 1e-5 * rng.standard_normal(len(time)))[:, None]
    tau = (100 * place + 0.01 * rng.standard_normal(len(time)))[:, None]
    found = find_holds(time, theta, tau)
    np.testing.assert_allclose(found.theta[:, 0], [0, 1e-2, 3e-2, 2e-2], atol=2e-5)
    np.testing.assert_allclose(found.tau[:, 0], [0, 1, 3, 2], atol=2e-2)
    assert found.approach[:, 0].tolist() == [0, 1, 1, -1]
    rows = find_holds(np.arange(4.0), found.theta, found.tau)
    assert rows.count == 4 and rows.approach[:, 0].tolist() == [0, 1, 1, -1]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[MeasurementSet, np.ndarray]:
    """A UR5 with a short motion and its pushes."""
    folder = tmp_path_factory.mktemp("static")
    truth = make_case(51, "none", "ur5", folder, duration=6.0)
    add_pushes(folder, truth, np.random.default_rng(51))
    return read_set(folder), np.array(truth["stiffness"])


def test_pushes_show_the_stiffness_that_motion_does_not(arm: tuple[MeasurementSet, np.ndarray]) -> None:
    measurements, stiffness = arm
    found = identify(measurements)
    own = [p for p in found.parameters if p.name == "stiffness"]
    assert [p.identifiable for p in own] == ["yes"] * 6
    np.testing.assert_allclose([p.value for p in own], stiffness, rtol=0.03)
    assert [fact.joints for fact in found.facts if fact.kind == "holds-used"] == [()]
    alone = identify(replace(measurements, holds=()))
    assert sum(p.identifiable == "yes" for p in alone.parameters if p.name == "stiffness") < 6


@pytest.mark.slow
def test_a_contradiction_of_motion_and_pushes_is_said(arm: tuple[MeasurementSet, np.ndarray]) -> None:
    measurements, _ = arm
    (group,) = measurements.holds
    tau = group.holds.tau.copy()
    tau[:, 1] *= 3.0
    holds = Holds(group.holds.time, group.holds.theta, tau, group.holds.approach)
    found = identify(replace(measurements, holds=(replace(group, holds=holds),)))
    assert [fact.joints for fact in found.facts if fact.kind == "holds-used"] == [measurements.joints[1:2]]


@pytest.mark.slow
def test_refined_within_three_per_cent() -> None:
    one = outcome(52)
    assert one.shown < 6 and set(one.grades) == {"yes"}
    assert max(map(abs, one.errors)) < 0.03


def hung_with(group: HoldGroup, holds: Holds) -> HoldGroup:
    """These holds of the free arm, with a weight at its flange."""
    weight = PayloadBody("wrist_3_link", 3.0, np.array([0.0, 0.05, 0.1]), np.zeros(6))
    return replace(group, name="hung", holds=holds, clamped=np.zeros(6, bool), bodies=(weight,))


@pytest.mark.parametrize("kind", ["pushes", "weights"])
def test_derivative_of_the_holds(arm: tuple[MeasurementSet, np.ndarray], kind: str) -> None:
    measurements, stiffness = arm
    (group,) = measurements.holds
    rng = np.random.default_rng(0)
    theta = rng.uniform(-1, 1, (12, 6))
    free = Holds(np.arange(12.0), theta, rng.normal(0, 20, (12, 6)), rng.choice([-1.0, 1.0], (12, 6)))
    kept = group if kind == "pushes" else hung_with(group, free)
    term, layout = HoldsTerm(replace(measurements, holds=(kept,))), layout_of(measurements)
    x = np.zeros(layout.size)
    x[layout.inertial] = measurements.robot.cad_parameters.ravel()
    x[layout.compliance] = 1 / stiffness
    jacobian = term.rows(x, layout)[1]
    compliances = range(layout.compliance.start, layout.compliance.stop)
    for k in (0, 11, 22, 30, 41, 52, *compliances):
        ends = np.tile(x, (2, 1))
        ends[:, k] += (1e-3 * x[k], -1e-3 * x[k]) if k in compliances else (1e-5, -1e-5)
        before, after = (term.rows(end, layout)[0] for end in ends[::-1])
        numeric = (after - before) / (ends[0, k] - ends[1, k])
        # on the column's own scale; how the deflection changes with the deflection is neglected
        np.testing.assert_allclose(numeric, jacobian[:, k], rtol=0, atol=0.05 * np.abs(numeric).max() + 1e-6)


NOISE = 0.1  # [Nm]


def weighed(arm: tuple[MeasurementSet, np.ndarray], noise: float) -> HoldGroup:
    """Gravity of arm and weight at poses that are reached from both sides."""
    measurements, stiffness = arm
    (group,) = measurements.holds
    rng = np.random.default_rng(3)
    poses = rng.uniform(-1, 1, (30, 6)).repeat(2, axis=0)
    still = np.zeros_like(poses)
    hung = hung_with(group, group.holds)
    load = measurements.robot.cad_torques(hung.bodies, poses, still, still)
    way = np.tile([[1.0], [-1.0]], (30, 6))
    measured = load + 2.0 * way + noise * rng.standard_normal(load.shape)
    return replace(hung, holds=Holds(np.arange(60.0), poses + load / stiffness, measured, way))


def test_weights_show_the_masses(arm: tuple[MeasurementSet, np.ndarray]) -> None:
    """Exact gravity leaves nothing at the truth, and much with other masses or the opposite deflection."""
    measurements, stiffness = arm
    term = HoldsTerm(replace(measurements, holds=(weighed(arm, 0.0),)))
    layout = layout_of(measurements)
    x = np.zeros(layout.size)
    x[layout.inertial], x[layout.compliance] = measurements.robot.cad_parameters.ravel(), 1 / stiffness
    count = len(term.rows(x, layout)[0])
    assert term.value(x, layout) < 1e-4 * count
    for part, factor in ((layout.compliance, -1.0), (layout.inertial, 1.1)):
        wrong = x.copy()
        wrong[part] *= factor
        assert term.value(wrong, layout) > count


def test_scatter_of_weights(arm: tuple[MeasurementSet, np.ndarray]) -> None:
    """The noise of τ, whatever the masses of the arm, the known weight, friction and offset."""
    robot = arm[0].robot
    found = free_holds(LinkDynamics(robot), robot, weighed(arm, NOISE))
    assert np.all((found.sigma > 0.8 * NOISE) & (found.sigma < 1.25 * NOISE))


def test_what_cannot_be_clamped_is_refused(arm: tuple[MeasurementSet, np.ndarray], tmp_path: Path) -> None:
    file = arm[0].path / "measurements.toml"
    text = file.read_text()
    try:
        file.write_text(text.replace("clamped = true", 'clamped = ["joint9"]'))
        with pytest.raises(InputError, match="joint9"):
            read_set(arm[0].path)
        file.write_text(text.replace('kind = "holds"\n', ""))
        with pytest.raises(InputError, match="a clamped arm does not move"):
            read_set(arm[0].path)
    finally:
        file.write_text(text)


@pytest.mark.slow
def test_a_static_test_is_designed(arm: tuple[MeasurementSet, np.ndarray], tmp_path: Path) -> None:
    found = design_static(subject_of(replace(arm[0], holds=())), seed=1)
    assert found.clamped == 6 and np.all(found.errors < 0.03) and np.all(found.hung > 0.03)
    assert found.force < 1000
    text = static_fact(found).text
    assert "That is not enough for any joint: clamp the flange." in text and "clamped = true" in text
    write_static(found, tmp_path / "out")
    assert (tmp_path / "out" / "pushes.csv").read_text().startswith("joint,torque\n")
    assert design_static(subject_of(replace(arm[0], holds=())), seed=1).pose.tolist() == found.pose.tolist()
