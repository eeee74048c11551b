"""Many effects at once: bounded steps, firm priors, unknown curves, a set with seven effects."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from benchmarks.diagnosis_study.cases import selected
from benchmarks.diagnosis_study.making import case_folder, make, truth_file
from flexviz import diagnose
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.analysis.diagnosis.unknown_curve import best_curve, curve_gain
from flexviz.analysis.estimation import Bounds, bounded_step
from flexviz.analysis.motion import MOTION, MotionContext, MotionFit, Phase
from flexviz.data.measurements import read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.effects.free_curve import SIZE, FreeFrictionCurve
from flexviz.model.equation import Layout
from tests.planar_arm import HELD_OUT, planar_set

SHARED = Path(__file__).parents[3] / "shared" / "robotlike"
CURVE = FreeFrictionCurve()
DEMO = Path(__file__).parents[2] / "sessions" / "planar-2r-demo"


def test_bounded_step_against_scipy():
    rng = np.random.default_rng(3)
    for _ in range(60):
        size = int(rng.integers(2, 20))
        a = rng.normal(size=(size + 3, size)) * 10 ** rng.uniform(-2, 2, size)
        a[:, 0] = a[:, -1] + 1e-3 * a[:, 0]  # nearly collinear
        b = rng.normal(size=size + 3)
        lower = -rng.uniform(0, 0.5, size) * (rng.random(size) < 0.7)
        upper = rng.uniform(0, 0.5, size)
        step, held = bounded_step(-a.T @ b, a.T @ a, np.zeros(size), Bounds(lower, upper))
        best = lsq_linear(a, b, (lower - 1e-15, upper + 1e-15), method="bvls", tol=1e-14)
        assert np.all((step >= lower) & (step <= upper))
        assert np.sum((a @ step - b) ** 2) <= 2 * best.cost * (1 + 1e-6) + 1e-9
        assert np.all((step[held] == lower[held]) | (step[held] == upper[held]))


@pytest.fixture(scope="module")
def context() -> MotionContext:
    measurements = read_set(DEMO)
    return MotionContext(measurements, measurements.joints, stand_ins=True)


def test_firm_prior_against_finite_differences(context):
    layout = Layout(context.measurements.joints)
    start = context.start(layout)
    prior, x = start.prior, start.x * 1.07
    gradient, _ = prior.gradient_and_hessian(x)
    for k in range(layout.compliance.start, layout.size):
        h = 1e-6 * x[k] if x[k] else 1e-9
        up, down = x.copy(), x.copy()
        up[k], down[k] = x[k] + h, x[k] - h
        slope = (prior.value(up) - prior.value(down)) / (2 * h)
        assert slope == pytest.approx(gradient[k], rel=1e-4, abs=1e-5 / max(abs(x[k]), 1e-3))
    assert np.isfinite(prior.log_spread[layout.compliance]).all()


def test_the_error_that_is_stated_is_that_of_the_groups_it_names(context):
    """Also without the standstill of a joint."""
    measurements = context.measurements
    fit = context.fit(Layout(measurements.joints), context.start(Layout(measurements.joints)).x, iterations=1)
    for held_out in (True, False):
        groups = measurements.groups if held_out else measurements.fit_groups
        band = PredictionErrorBand(replace(measurements, groups=groups))
        for first in (None, np.array([Phase.MOTION, Phase.REST], np.int8)):
            every = band.errors(fit, first)
            expected = every.rms_validation if held_out else every.rms
            assert every.stated == expected
            assert every.stated_name == ("validation" if held_out else "fit")


@pytest.fixture(scope="module")
def plain(context) -> MotionFit:
    """The demonstration's model without the friction that it hides on joint 2."""
    layout = Layout(context.measurements.joints)
    return context.fit(layout, context.start(layout).x)


def test_gain_of_a_free_curve_against_least_squares(context, plain):
    """The decrease of |r|² and the priors' cost by a curve and all parameters together."""
    curve = ChosenEffect("free_curve_friction", 1)
    larger = Layout(plain.layout.joints, (curve,))
    nodes = larger.effect_slice(curve)
    prior = context.start(larger).prior
    x = larger.vector(plain.layout.model(plain.x))
    x[nodes] = context.start(larger).x[nodes]
    point = context.equation(larger).at(x).evaluate(x, moving=True)
    free = np.r_[0 : nodes.start, nodes.start + 2 : nodes.stop]
    columns = (point.jacobian * plain.weights[:, :, None]).reshape(-1, larger.size)[:, free]
    gradient, hessian = prior.gradient_and_hessian(x)
    right = columns.T @ (point.residual * plain.weights).ravel() + gradient[free]

    def decrease(rows: slice) -> float:
        matrix = (columns.T @ columns + hessian[np.ix_(free, free)])[rows, rows]
        return float(right[rows] @ np.linalg.solve(matrix, right[rows]))

    expected = decrease(slice(None)) - decrease(slice(0, nodes.start))
    assert curve_gain(plain, curve) == pytest.approx(expected, rel=1e-3)
    assert expected > 0.3 * len(plain.weights)
    best, gain = best_curve(plain, 1)  # Coulomb friction is the same at every position
    assert best.effect in ("free_curve_friction", "free_link_curve_friction") and gain > 0.99 * expected


def test_what_an_effect_explains_is_not_left_to_a_curve(context, plain):
    """Coulomb friction beside a free curve of friction, which could take its place."""
    curve, coulomb = ChosenEffect("free_curve_friction", 1), ChosenEffect("coulomb_friction", 1)
    layout = Layout(plain.layout.joints, (curve, coulomb))
    fit = context.fit(layout, context.start(layout).bounds.clip(layout.vector(plain.layout.model(plain.x))))
    alone = Layout(plain.layout.joints, (coulomb,))
    without = context.fit(alone, alone.vector(layout.model(fit.x)))
    size = without.x[alone.effect_slice(coulomb)][0]
    assert fit.x[layout.effect_slice(coulomb)][0] == pytest.approx(size, rel=0.02)
    # a constant added to all nodes costs as much as its standard deviation says
    ((_, precision),) = context.start(layout).prior.coupled
    branch = np.array(CURVE.branches[0])
    level = np.zeros(len(precision))
    level[branch] = context.spread[1]
    expected = MOTION.hidden_torque**-2 + len(branch) / SIZE**2
    assert level @ precision @ level == pytest.approx(expected, rel=1e-9)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the robot-like sets are not beside this checkout")
def test_seven_effects_at_once():
    name = "robotlike-2r-00"
    truth = json.loads((SHARED / "truth" / f"{name}.json").read_text())
    result = diagnose(read_set(SHARED / "cases" / name), apply=True)
    found = {(e.effect, e.joint): e.parameters for e in result.effects}
    assert set(found) == {(e["effect"], e["joint"]) for e in truth["effects"]}
    errors = [
        abs(found[e["effect"], e["joint"]][k].value / v - 1)
        for e in truth["effects"]
        for k, v in e["parameters"].items()
    ]
    assert np.median(errors) < 0.01 and max(errors) < 0.03
    last = result.steps[-1]
    assert last.verdict == "nothing-missing"
    assert np.all(np.array(last.rms_validation) < 4 * np.array(last.noise_floor))
    added = [s.added for s in result.steps if s.added is not None]
    assert all((f.family.confidence if f.family else f.confidence) > 0.9 for f in added)
    stiffness = [p.value for p in result.parameters if p.name == "stiffness"]
    np.testing.assert_allclose(stiffness, truth["stiffness"], rtol=0.05)


@pytest.mark.slow
def test_a_law_of_no_library_stays_unknown_and_is_located(tmp_path):
    (case,) = selected(7, "unknown-2r-002-sawtooth_cogging")
    make(tmp_path, case)
    result = diagnose(read_set(case_folder(tmp_path, case.name)), apply=True)
    assert result.steps[-1].verdict == "unknown"
    (hidden,) = json.loads(truth_file(tmp_path, case.name).read_text(encoding="utf-8"))["effects"]
    assert (result.where[0].joint, result.where[0].variable) == (hidden["joint"], "position")
    curve = result.free_curve
    assert curve is not None and curve.joint == hidden["joint"] and curve.certain


@pytest.mark.slow
def test_what_a_few_usual_effects_explain_is_not_sought_elsewhere(tmp_path):
    """Two effects that the usual ones include: no place of an unknown law is tried."""
    hidden = ("coulomb_friction:joint1:coulomb=4", "coulomb_friction:joint2:coulomb=2")
    told = []
    result = diagnose(
        planar_set(tmp_path / "arm", hidden, 5, groups=HELD_OUT),
        apply=True,
        guard=False,
        progress=lambda news: told.append(news.text),
    )
    found = {(e.effect, e.joint): e.parameters["coulomb"].value for e in result.effects}
    right = {("coulomb_friction", "joint1"): 4.0, ("coulomb_friction", "joint2"): 2.0}
    assert found == pytest.approx(right, rel=1e-3)
    assert result.steps[-1].verdict == "nothing-missing"
    assert not [text for text in told if "place" in text or "unknown" in text]
