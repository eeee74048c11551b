"""Identification against known truth, and its parts against closed forms and Monte Carlo."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexviz.analysis.estimation import Bounds, Descent, bounded_step, gauss_newton
from flexviz.analysis.estimation.base_inertials import base_parameters
from flexviz.analysis.estimation.covariance import sandwich, score_covariance
from flexviz.analysis.estimation.noise_propagation import NoiseDerivatives
from flexviz.analysis.estimation.transients import outside_transients
from flexviz.analysis.estimation.whitening import lagged_covariance, noise_kernel, whitener
from flexviz.analysis.identification import Identification, identify, sweep
from flexviz.base.errors import InputError
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import read_set
from flexviz.data.noise import white_noise
from flexviz.model.equation import Layout
from flexviz.model.observers import FlatZeroPhase
from flexviz.model.simulation import make_plan, simulate_plan, write_plan
from flexviz.robot.robot import Robot
from tests.cases import slow
from tests.covariances import dense_covariance
from tests.planar_arm import of_groups, planar_set

SHARED = Path(__file__).resolve().parents[3] / "shared"
CLEAN = SHARED / "practice" / "cases" / "2r-none-19"
PANDA = ("t1p1", "t2p2", "t3p3")  # of its groups
KUKA = SHARED / "real" / "kuka_kr300"


def truth_of(folder: Path) -> dict[tuple[str, str], float]:
    document = json.loads((folder / "truth.json").read_text())
    return {(p["name"], p["joint"]): p["value"] for p in document["parameters"]}


@pytest.fixture(scope="module")
def demo_fit(demo) -> Identification:
    return identify(demo, effects=["coulomb_friction:joint2"], refine=True)


def errors(result: Identification, truth: dict[tuple[str, str], float], name: str) -> np.ndarray:
    pairs = [(p.value, truth[p.name, p.joint]) for p in result.parameters if p.name == name and p.joint]
    return np.array([value / true - 1 for value, true in pairs])


# -- whole ----------------------------------------------------------------------


def test_refinement_recovers_the_demo(demo_fit):
    truth = truth_of(sessions_dir() / "planar-2r-demo")
    assert demo_fit.converged and demo_fit.refined
    assert np.abs(errors(demo_fit, truth, "stiffness")).max() < 2e-3
    assert np.abs(errors(demo_fit, truth, "motor_inertia")).max() < 2e-3
    assert np.abs(errors(demo_fit, truth, "viscous_friction_sum")).max() < 5e-3
    for combination in demo_fit.combinations:
        true = sum(w * truth[tuple(k.split(":"))] for k, w in combination.weights.items())  # type: ignore[index]
        assert abs(combination.value - true) < max(5e-3 * abs(true), 2e-3), combination.name
        assert combination.identifiable == "yes", combination.name


def test_missing_effect_raises_the_error(demo, demo_fit):
    without = identify(demo)
    assert without.residual.rms_validation is not None and demo_fit.residual.rms_validation is not None
    assert without.residual.rms_validation[1] > 3 * demo_fit.residual.rms_validation[1]
    assert demo_fit.residual.rms[1] < 4 * demo_fit.residual.noise_floor[1] < without.residual.rms[1]


def test_json_is_the_contract(demo_fit):
    document = json.loads(json.dumps(demo_fit.to_dict()))
    assert document["format"] == 1 and document["converged"] is True
    names = {(p["name"], p["joint"]) for p in document["parameters"]}
    for joint in ("joint1", "joint2"):
        for name in (
            "stiffness",
            "motor_inertia",
            "link_viscous_friction",
            "viscous_friction_sum",
            "izz",
            "mass",
        ):
            assert (name, joint) in names
    assert ("coulomb_friction.coulomb", "joint2") in names and (
        "coulomb_friction.coulomb",
        "joint1",
    ) not in names
    assert all(p["identifiable"] in ("yes", "weak", "no") for p in document["parameters"])
    residual = document["residual"]
    keys = {"joints", "rms", "rms_validation", "noise_floor", "torque_spread", "rms_between_reversals"}
    assert set(residual) == keys | {"noise_share"}
    assert all(rms < spread for rms, spread in zip(residual["rms"], residual["torque_spread"], strict=True))


def test_masses_of_a_planar_arm_are_not_identifiable(demo_fit):
    by_name = {(p.name, p.joint): p for p in demo_fit.parameters}
    for joint in ("joint1", "joint2"):
        assert by_name["mass", joint].identifiable == "no"
        assert by_name["stiffness", joint].identifiable == "yes"
    assert by_name["mx", "joint2"].identifiable == "yes"
    assert "mass:joint2" in by_name["mx", "joint1"].tied_to


@pytest.mark.parametrize("factor", [0.3, slow(10.0)])
def test_rough_stiffness_does_not_matter(demo, demo_fit, factor):
    from dataclasses import replace

    far = replace(demo, initial_stiffness=factor * demo_fit.model.stiffness, initial_motor_inertia=None)
    result = identify(far, effects=["coulomb_friction:joint2"], bandwidth=2 * np.pi * 6)
    near = identify(demo, effects=["coulomb_friction:joint2"], bandwidth=2 * np.pi * 6)
    np.testing.assert_allclose(result.model.stiffness, near.model.stiffness, rtol=1e-3)
    np.testing.assert_allclose(result.model.motor_inertia, near.model.motor_inertia, rtol=1e-3)


def test_stopping_keeps_what_there_is(demo):
    seen = []
    result = identify(demo, progress=seen.append, should_stop=lambda: len(seen) >= 3)
    assert result.stopped and not result.converged
    assert len(result.iterations) == len(seen) == 3
    assert result.iterations[-1].cost < result.iterations[0].cost
    assert np.all(np.isfinite(result.model.stiffness))


def test_unknown_names(demo):
    with pytest.raises(InputError, match="t1p1"):
        identify(demo, groups=["t1p9"])
    with pytest.raises(InputError, match="coulomb_friction"):
        identify(demo, effects=["coulomb"])
    with pytest.raises(InputError, match="at least one"):
        identify(demo, groups=[])


def test_a_validation_group_is_never_fitted(demo):
    held_out, usable = demo.validation_groups[0].name, demo.fit_groups[0].name
    for names in ([held_out], [usable, held_out]):
        with pytest.raises(InputError, match=f'"{held_out}" is for validation.*{usable}'):
            identify(demo, groups=names)


@pytest.mark.slow
def test_panda_within_five_percent_where_identifiable(tmp_path):
    plan = of_groups(make_plan("panda"), PANDA, 8.0)
    out = write_plan(plan, simulate_plan(plan, 3), tmp_path / "panda", 3)
    truth = truth_of(out)
    result = identify(read_set(out))
    stiffness = [p for p in result.parameters if p.name == "stiffness"]
    sure = [p for p in stiffness if p.identifiable == "yes"]
    assert len(sure) >= 4
    for p in sure:
        assert p.joint and p.value == pytest.approx(truth["stiffness", p.joint], rel=0.05), p.joint


@pytest.mark.skipif(not CLEAN.exists(), reason="the practice cases are not beside this checkout")
def test_practice_case_stiffness_and_inertia():
    result = identify(read_set(CLEAN), refine=True)
    truth = json.loads((CLEAN.parents[1] / "truth" / "2r-none-19.json").read_text())
    np.testing.assert_allclose(result.model.stiffness, truth["stiffness"], rtol=1e-3)
    np.testing.assert_allclose(result.model.motor_inertia, truth["motor_inertia"], rtol=1e-3)
    np.testing.assert_allclose(result.model.link_viscous_friction, truth["viscous_link"], rtol=2e-2)
    np.testing.assert_allclose(result.model.motor_viscous_friction, truth["viscous_motor"], rtol=1e-2)


@pytest.mark.skipif(not KUKA.exists(), reason="the real robot's recording is not beside this checkout")
def test_real_robot_is_bounded_and_beats_rigid_least_squares():
    from benchmarks.rigid import rigid_held_out

    measurements = read_set(KUKA)
    result = identify(measurements, effects=["coulomb_friction"], refine=True)
    assert result.converged and "in the band of the motion" in result.message  # far above the noise
    model = result.model
    for values in (model.stiffness, model.motor_inertia):
        assert np.all(np.isfinite(values)) and np.all(values > 0)
    assert np.all(model.link_viscous_friction >= 0) and np.all(model.motor_viscous_friction >= 0)
    flexible, rigid = rigid_held_out(measurements, result)
    assert flexible.mean() <= rigid.mean()


# -- parts ----------------------------------------------------------------------


def test_base_parameters_of_the_planar_arm():
    base = base_parameters(Robot.load("robots:planar_2r"))
    assert set(base.names) == {
        "izz:joint1 + 1 mass:joint2",
        "mx:joint1 + 1 mass:joint2",
        "my:joint1",
        "izz:joint2",
        "mx:joint2",
        "my:joint2",
    }


def test_base_parameters_span_the_regressor():
    from flexviz.model.equation.link import LinkDynamics

    robot = Robot.load("example-robot-data:ur5")
    base = base_parameters(robot)
    q, v, a = np.random.default_rng(4).uniform(-2, 2, (3, 50, robot.n))
    y = LinkDynamics(robot).regressor(q, v, a).reshape(-1, 10 * robot.n)
    np.testing.assert_allclose(y[:, list(base.columns)] @ base.matrix, y, atol=1e-7 * np.abs(y).max())
    assert np.linalg.matrix_rank(y) == len(base.columns)


def test_step_stays_within_bounds():
    hessian = np.array([[2.0, 0.5], [0.5, 1.0]])
    bounds = Bounds(np.array([0.0, -np.inf]), np.full(2, np.inf))
    step, fixed = bounded_step(np.array([3.0, 1.0]), hessian, np.array([0.5, 0.0]), bounds)
    assert list(fixed) == [True, False] and step[0] == -0.5
    assert step[1] == pytest.approx((-1.0 + 0.5 * 0.5) / 1.0)


class CurvedEquation:
    """r(x) = (x + 1, λx² + x − 1): Gauss–Newton's steps near the minimum x = 0 are each λ times the last.

    Dennis, Schnabel: Numerical Methods for Unconstrained Optimization, section 10.2.
    """

    has_state = False
    signals = SimpleNamespace(
        tau=np.ones((1, 2, 1)), known=np.ones((2, 1)), mean_square=lambda r: np.mean(r**2, axis=0)
    )
    layout = SimpleNamespace(compliance=slice(0, 0), fitted=np.ones(1))

    def __init__(self, curvature: float) -> None:
        self.curvature = curvature

    def at(self, x, after=None):
        return self

    def evaluate(self, x):
        residual = np.array([x + 1, self.curvature * x**2 + x - 1])
        jacobian = np.array([[[1.0]], [[2 * self.curvature * x[0] + 1]]])
        return SimpleNamespace(residual=residual, jacobian=jacobian)


@pytest.mark.parametrize("curvature", [-0.95, 0.9])
def test_slow_steps_are_extrapolated(curvature, monkeypatch):
    """0.95ⁿ would need about 90 iterations, 0.9ⁿ 40."""
    monkeypatch.setitem(Descent.__init__.__kwdefaults__, "negligible", 1e-4)
    flat = SimpleNamespace(
        value=lambda x: 0.0,
        feasible=lambda x: True,
        gradient_and_hessian=lambda x: (np.zeros(1), np.zeros((1, 1))),
    )
    bounds = Bounds(np.array([-10.0]), np.array([10.0]))

    equation = CurvedEquation(curvature)
    solution = gauss_newton(
        equation,  # type: ignore[arg-type]
        flat,  # type: ignore[arg-type]
        bounds,
        np.array([1.0]),
        max_iterations=15,
    )
    assert solution.converged
    assert abs(solution.x[0]) < 0.01


def test_white_noise_from_fourth_differences():
    rng = np.random.default_rng(0)
    t = 1e-3 * np.arange(60000)
    y = np.sin(6 * t)[:, None] + rng.standard_normal((60000, 3)) * [1e-5, 1e-4, 1e-3]
    np.testing.assert_allclose(white_noise(y), [1e-5, 1e-4, 1e-3], rtol=0.025)


def test_noise_kernel_against_filtered_noise():
    rng = np.random.default_rng(2)
    observer, raw, stride = FlatZeroPhase(2 * np.pi * 10), 1e-3, 25
    out = observer.derivatives(rng.standard_normal((400_000, 1)), raw, 5, stride=stride)[:, 200:-200, 0]
    kernel = noise_kernel(observer, raw * stride, raw, NoiseDerivatives.plain(5), 3)
    for lag in range(4):
        ahead, behind = out[:, lag:], out[:, : out.shape[1] - lag]
        empirical = ahead @ behind.T / behind.shape[1]
        size = np.sqrt(np.outer(np.diag(kernel[0]), np.diag(kernel[0])))
        assert np.abs((kernel[lag] - empirical) / size).max() < 0.03


def test_whitening_inverts_the_covariance():
    rng = np.random.default_rng(3)
    count, n = 60, 2
    observer = FlatZeroPhase(2 * np.pi * 8)
    kernel = noise_kernel(observer, 0.05, 1e-3, NoiseDerivatives.plain(3), count - 1)
    sensitivity = rng.standard_normal((3, 1, n, n)) + 0.3 * rng.standard_normal((3, count, n, n))
    lagged = lagged_covariance(sensitivity, kernel, np.array([1.0, 2.0]))
    lagged[0] += 1e-3 * np.eye(n) * np.trace(lagged[0].mean(axis=0))
    matrix = dense_covariance(lagged)
    tool = whitener(lagged)
    white = tool.apply(np.eye(count * n).reshape(count, n, count * n)).reshape(count * n, -1)
    np.testing.assert_allclose(white @ matrix @ white.T, np.eye(count * n), atol=1e-6)


def test_sandwich_matches_monte_carlo_for_coloured_noise():
    rng = np.random.default_rng(1)
    count = 600
    t = np.arange(count)
    jacobian = np.stack([np.sin(0.05 * t), np.ones(count), t / count], axis=1)[:, None, :]
    information = np.einsum("tip,tiq->pq", jacobian, jacobian)
    estimates, predicted = [], []
    for _ in range(400):
        white = rng.standard_normal(count + 50)
        noise = np.zeros(count + 50)
        for k in range(1, count + 50):
            noise[k] = 0.9 * noise[k - 1] + white[k]
        noise = noise[50:, None]
        estimates.append(np.linalg.solve(information, np.einsum("tip,ti->p", jacobian, noise)))
        if len(predicted) < 60:
            colour = score_covariance(noise, jacobian, [slice(0, count)])
            predicted.append(np.diag(sandwich(information, colour, np.zeros((3, 3))).matrix))
    ratio = np.sqrt(np.mean(predicted, axis=0)) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.7) & (ratio < 1.2)), ratio


def test_rounding_of_a_large_score_leaves_the_uncertainty_of_the_prior():
    """Only the sum of two parameters is measured; the model errs a lot: the prior holds their difference."""
    information = 1e10 * np.ones((2, 2))
    score = 1e10 * information
    score[0, 0] -= 2 * np.spacing(score[0, 0])
    found = sandwich(information, score, np.eye(2))
    assert np.all(found.standard_errors >= 0.99 * np.sqrt(0.5))
    assert np.all(found.prior_share <= 1.0 + 1e-9)


def test_transients_at_the_ends_are_found():
    rng = np.random.default_rng(0)
    r = rng.standard_normal((800, 2))
    used, cost = outside_transients(r)
    assert used.all() and cost == 0.0
    r[:35] += 30 * np.exp(-np.arange(35) / 10)[:, None]
    used, cost = outside_transients(r)
    assert not used[:20].any() and used[60:].all()
    dropped = r[~used].reshape(-1, 10, 2)  # in windows of 10 samples
    assert cost == pytest.approx(10 * np.log(np.maximum((dropped**2).mean(axis=1), 1.0)).sum())


def test_names_match_the_layout():
    layout = Layout(("a", "b"))
    assert len(layout.names()) == layout.size == 28
    assert layout.names()[layout.compliance.start] == ("stiffness", "a", "Nm/rad")


@pytest.mark.slow
def test_sweep_has_its_minimum_inside(demo):
    result = sweep(
        demo,
        "butterworth-zero-phase",
        2 * np.pi * np.array([1.0, 4.0, 6.0, 20.0]),
        effects=["coulomb_friction"],
    )
    assert len(result.bandwidths) >= 3 and result.rms_validation.shape == (len(result.bandwidths), 2)
    assert result.bandwidths[0] < result.best < result.bandwidths[-1]
    with pytest.raises(InputError, match="settle"):
        sweep(demo, "eso", [0.1])


@pytest.mark.parametrize(
    ("effect", "text"),
    [
        ("torque_ripple", "torque_ripple:joint1:amplitude=4,order=7,phase=0.5"),
        ("stribeck_friction", "stribeck_friction:joint2:stribeck=3,velocity=0.2"),
    ],
)
def test_nonlinear_effects_are_searched_for(tmp_path, effect, text):
    joint = text.split(":")[1]
    result = identify(
        planar_set(tmp_path / "set", [text], seed=2), effects=[f"{effect}:{joint}"], refine=True
    )
    wanted = dict(pair.split("=") for pair in text.split(":")[2].split(","))
    for name, value in wanted.items():
        assert result[f"{effect}.{name}", joint].value == pytest.approx(float(value), rel=0.03), name


def test_contact_named_by_joint_and_group_is_searched_for(tmp_path):
    hidden = "external_contact:joint2:torque=6,start=3.13,end=4.87,group=t2p2"
    measurements = planar_set(tmp_path / "set", [hidden], seed=3)
    result = identify(measurements, effects=["external_contact:joint2@t2p2"], refine=True)
    found = {k: result[f"external_contact.{k}", "joint2"].value for k in ("torque", "start", "end")}
    assert found["torque"] == pytest.approx(6.0, rel=0.02)
    assert found["start"] == pytest.approx(3.13, abs=0.01)
    assert found["end"] == pytest.approx(4.87, abs=0.01)
    assert [e.text for e in result.model.effects] == ["external_contact:joint2@t2p2"]
    with pytest.raises(InputError, match="not fitted"):
        identify(measurements, effects=["external_contact:joint2@t2p2"], groups=["t1p1"])
