"""The diagnosis' parts: projections, looked-up pulses, judging, model errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.diagnosis.candidates import credible, excess, with_effects
from flexviz.analysis.diagnosis.coarse import Coarse
from flexviz.analysis.diagnosis.fine import Fine
from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.diagnosis.ties import telling_motion
from flexviz.analysis.estimation import ESTIMATION, Whitening
from flexviz.analysis.estimation.noise_propagation import NoiseDerivatives
from flexviz.analysis.estimation.score_test import Projection, explained
from flexviz.analysis.estimation.whitening import lagged_covariance, noise_kernel, whitener
from flexviz.analysis.identification import identify
from flexviz.analysis.motion import MOTION, MotionContext
from flexviz.data.measurements import read_set
from flexviz.model.effects import EFFECT_FAMILIES, EFFECTS, ChosenEffect
from flexviz.model.equation import Equation, Layout, build_signals
from flexviz.model.observers import FlatZeroPhase
from flexviz.robot.model import FlexibleModel
from tests.cases import slow
from tests.covariances import dense_covariance

KUKA = Path(__file__).resolve().parents[3] / "shared" / "real" / "kuka_kr300"


@pytest.fixture(scope="module")
def plain(demo: Any) -> FlexibleModel:
    """The fit of the demonstration without any effect."""
    return identify(demo, refine=False).model


@pytest.fixture(scope="module")
def base(demo: Any, plain: FlexibleModel) -> tuple[FitContext, Fit]:
    layout = Layout(demo.joints)
    fit_context = FitContext(demo, layout)
    return fit_context, fit_context.fit(layout, layout.vector(plain), iterations=12)


def test_projection_agrees_with_taking_it_out_explicitly() -> None:
    rng = np.random.default_rng(0)
    z, h, r = rng.standard_normal((200, 5)), rng.standard_normal((200, 3)), rng.standard_normal(200)
    h[:50] = 0.0
    hessian = z.T @ z + np.diag([0.0, 1.0, 2.0, 0.0, 3.0])
    projection = Projection(r, z, hessian)
    left = h - z @ np.linalg.solve(hessian, z.T @ h)
    np.testing.assert_allclose(projection.rest(h), left, atol=1e-12)
    gram, along = projection.normal(h[50:], slice(50, 200))
    np.testing.assert_allclose(gram, left.T @ left, atol=1e-10)
    np.testing.assert_allclose(along, left.T @ r, atol=1e-10)
    coefficients, gain = explained(gram, along)
    assert gain == pytest.approx(r @ r - np.sum((r + left @ coefficients) ** 2))
    assert gain == pytest.approx(r @ r - np.linalg.lstsq(left, r, rcond=None)[1][0])


def test_signatures_of_the_model_itself_explain_nothing() -> None:
    rng = np.random.default_rng(1)
    z, r = rng.standard_normal((100, 4)), rng.standard_normal(100)
    gram, along = Projection(r, z, z.T @ z).normal(z[:, :2] @ rng.standard_normal((2, 3)))
    assert not gram.any() and not along.any()


@pytest.mark.parametrize(("every", "ridge"), [(1, 1e-3), (4, 0.0), (4, 1e-6)])
def test_a_cheaper_whitener_still_gives_unit_variance(every: int, ridge: float) -> None:
    rng = np.random.default_rng(3)
    count, n, order = 200, 2, 12
    kernel = noise_kernel(FlatZeroPhase(2 * np.pi * 8), 0.05, 1e-3, NoiseDerivatives.plain(3), count - 1)
    slow = np.cos(0.02 * np.arange(count))[None, :, None, None]  # as slow as a pose
    sensitivity = rng.standard_normal((3, 1, n, n)) * (1 + 0.3 * slow)
    lagged = lagged_covariance(sensitivity, kernel, np.array([1.0, 2.0]))
    lagged[0] += 1e-3 * np.eye(n) * np.trace(lagged[0].mean(axis=0))
    matrix = dense_covariance(lagged)
    tool = whitener(lagged[: order + 1], every, ridge)
    white = tool.apply(np.eye(count * n).reshape(count, n, count * n)).reshape(count * n, -1)
    np.testing.assert_allclose(np.diag(white @ matrix @ white.T), 1.0, atol=0.02)


def test_pulses_and_steps_are_what_filtering_makes_of_them(demo: Any) -> None:
    signals = build_signals(demo, demo.groups[:1], FlatZeroPhase(2 * np.pi * 8))
    equation = Equation(demo.robot, signals, Layout(demo.joints))
    x = equation.layout.vector(identify(demo, groups=[demo.groups[0].name]).model)
    context = equation.at(x).context
    motion = context.motions(0)[0]
    at = np.array([len(motion.time) // 3, len(motion.time) // 2])
    part = np.zeros((2, len(motion.time)))
    part[[0, 1], at] = 1.0
    exact = context.filtered_block(0, part, 0, 3)
    found = context.pulses_block(0, at, 0, 3)
    for level in range(3):
        np.testing.assert_allclose(
            found[:, level], exact[:, level], atol=2e-3 * np.abs(exact[:, level]).max()
        )
    instants = np.array([3.0007, 5.5])
    step = motion.time[1] - motion.time[0]
    part = np.clip((motion.time - instants[:, None]) / step + 0.5, 0.0, 1.0)
    exact = context.filtered_block(0, part, 0, 1)[:, 0]
    inside = signals.time < signals.time[-1] - 1.0  # beyond, the filter's continuation of a record differs
    np.testing.assert_allclose(context.steps_block(0, instants, 0)[:, inside], exact[:, inside], atol=3e-3)


def test_fewer_samples_of_smooth_columns_suffice(demo: Any, plain: FlexibleModel) -> None:
    signals = build_signals(demo, demo.groups[:1], FlatZeroPhase(2 * np.pi * 6))
    equation = Equation(demo.robot, signals, Layout(demo.joints))
    context = equation.at(equation.layout.vector(plain)).context
    motion = context.motions(0)[0]
    wave = np.sin(20 * motion.position)[None]
    (few,) = context.decimation(0, 3, 40 * float(np.abs(motion.velocity).max()))
    assert few > 1
    exact = context.filtered_block(0, wave, 0, 3)
    found = context.filtered_block(0, wave[:, ::few], 0, 3, few)
    for level in range(3):  # beyond its ends a record is continued with a kink, which is folded back
        np.testing.assert_allclose(
            found[:, level], exact[:, level], atol=5e-4 * np.abs(exact[:, level]).max()
        )
    assert context.decimation(0, 3, 1e9) == [1]  # no grid is fine enough


def test_residual_alone_is_the_residual(demo: Any, plain: FlexibleModel) -> None:
    signals = build_signals(demo, demo.groups[:2], FlatZeroPhase(2 * np.pi * 6))
    for names in ((), (ChosenEffect("coulomb_friction", 1),), (ChosenEffect("presliding_hysteresis", 0),)):
        layout = Layout(demo.joints, names)
        equation = Equation(demo.robot, signals, layout)
        x = np.zeros(layout.size)
        x[: layout.effect_start] = Layout(demo.joints).vector(plain)
        x[layout.effect_start :] = 2.0
        seen = equation.at(x)
        np.testing.assert_allclose(seen.residual(x), seen.evaluate(x).residual, atol=1e-9)


def test_what_is_judged(base: tuple[FitContext, Fit]) -> None:
    fit = base[1]
    effect = ChosenEffect("torque_gain", 0)

    def with_value(effect: ChosenEffect, value: float) -> Fit:
        start = with_effects(fit, {effect: np.array([value])})
        layout, x = start.layout, start.x
        return replace(fit, layout=layout, x=x)

    gain = EFFECTS["torque_gain"]
    assert gain.at_bound(np.array([-0.8])) and not gain.at_bound(np.array([-0.1]))
    for size, possible in ((-0.1, True), (-0.6, True), (-0.8, False)):  # a bound is where a search diverged
        assert credible(with_value(effect, size), effect, 1e-3, False) == possible
    delay = ChosenEffect("torque_delay")
    assert credible(with_value(delay, 5e-4), delay, 1e-3, False)
    assert not credible(with_value(delay, 1e-5), delay, 1e-3, False)  # a hundredth of the record's step
    assert excess(fit) > 10


def test_what_a_complete_model_may_leave(demo: Any) -> None:
    """Noise, known within 2 %, and a trace of what the effects explain: no law is exact."""
    own = Layout(demo.joints)
    layout = Layout(demo.joints, (ChosenEffect("coulomb_friction", 1),))
    fine = Fine(FitContext(demo, own), own, lambda _: None)
    x = fine.context.start(layout).x.copy()
    x[layout.effect_start :] = 0.0
    bare = fine.begin(layout, x, 0)
    x[layout.effect_start :] = 0.4
    model = fine.begin(layout, x, 0)
    exactness, trace = THRESHOLDS.criterion.exactness, np.mean(bare.fit.point.r**2, axis=0)
    expected = (1 + MOTION.noise_known) * np.sqrt(1 + exactness**2 * trace)
    np.testing.assert_allclose(fine.criterion.least, expected, rtol=1e-4)
    below, above = (replace(model.score, deviation=f * fine.criterion.least) for f in (0.99, 1.5))
    noise, least = np.full(2, 0.1), np.full(2, 0.01)
    assert not fine.errs(replace(model, score=below), noise, least)
    assert fine.errs(replace(model, score=above), noise, least)
    one = replace(model.score, deviation=fine.criterion.least * np.array([1.0, 1.5]))
    assert fine.errs(replace(model, score=one), noise, least)  # a single joint is enough


@pytest.mark.parametrize("said", [slow(1), 2, slow(4), 7])
def test_a_stop_at_any_time_gives_what_was_found_by_then(demo: Any, said: int) -> None:
    """And no more: no effect is added that the search had not accepted."""
    calls: list[bool] = []

    def stop() -> bool:
        calls.append(True)
        return len(calls) > 3 * said

    result = diagnose(demo, apply=True, should_stop=stop)
    assert result.stopped == (len(calls) > 3 * said) and result.steps and result.model is not None
    assert {f.text for f in result.findings} <= {"coulomb_friction:joint2"}
    assert len(result.steps) == 1 + len(result.findings)
    assert len(result.model.effects) == len(result.findings)


def test_what_tells_two_effects_apart_is_named(demo: Any) -> None:
    own = Layout(demo.joints)
    view = Coarse(MotionContext(demo, own.joints, stand_ins=True), own, lambda _: None)
    signals = view.context.signals
    rng = np.random.default_rng(0)
    mine = np.zeros((signals.count, 2))
    speed = np.abs(signals.theta[1, :, 1])
    fast = speed > np.quantile(speed, 0.9)
    mine[fast, 1] = 1.0
    other = mine + 0.0
    other[fast, 1] += rng.standard_normal(fast.sum())
    mine, other = (m.ravel() / np.linalg.norm(m) for m in (mine, other))
    effect = ChosenEffect("coulomb_friction", 1)
    assert f"fast motion of {own.joints[1]}" in telling_motion(view, effect, mine, other)
    assert "same" in telling_motion(view, effect, mine, mine)


def test_errors_of_every_group_add_up(demo: Any, base: tuple[FitContext, Fit]) -> None:
    errors = PredictionErrorBand(demo).errors(base[1])
    assert [one.name for one in errors.groups] == [g.name for g in demo.groups]
    assert [one.validation for one in errors.groups] == [g.validation for g in demo.groups]
    held_out = [one.rms for one in errors.groups if one.validation]
    assert errors.rms_validation == pytest.approx(held_out[0])
    assert all(floor < rms for floor, rms in zip(errors.noise_floor, errors.rms, strict=True))


def test_without_apply_the_model_stays_what_it_is(demo: Any) -> None:
    looked = diagnose(demo, apply=False)
    assert looked.verdict == "missing" and looked.findings[0].text == "coulomb_friction:joint2"
    assert looked.effects == () and len(looked.steps) == 1
    assert looked.where[0].joint == "joint2" and looked.where[0].explained > 0.5
    evidence = looked.findings[0].evidence
    assert evidence is not None and evidence.joint == "joint2"
    left = evidence.residual - evidence.signature
    assert left.std() < 0.2 * evidence.residual.std()
    assert looked.findings[0].absorbed


@pytest.mark.slow
@pytest.mark.skipif(not KUKA.is_dir(), reason="the real robot's recording is not beside this checkout")
def test_a_real_robot_step_by_step() -> None:
    from benchmarks.real import held_out_share

    measurements = read_set(KUKA)
    result = diagnose(measurements, apply=True)
    shares = [held_out_share(measurements, s.model).mean() for s in result.steps if s.model is not None]
    assert result.verdict == "missing" and result.steps[-1].verdict == "unknown"
    assert shares[0] > 0.3 and shares[-1] <= 0.12
    added = {(s.added.effect, s.added.joint) for s in result.steps if s.added is not None}
    dry = (*EFFECT_FAMILIES["dry_friction"], "load_dependent_friction")
    assert {joint for effect, joint in added if effect in dry} == set(measurements.joints)
    springs = {joint for effect, joint in added if effect in ("gravity_compensator", "cable_spring")}
    assert springs == {"joint_2"}
    assert any(note.kind == "model-error" for note in result.notes)
    assert any(note.kind == "standstill" for note in result.notes) and result.free_curve is not None
    found = [s.added for s in result.steps if s.added is not None]
    # start-up friction is found in the first movements; its confidence is that of the whole record
    found = [f for f in found if f.effect != "startup_friction"]
    assert all((f.family.confidence if f.family else f.confidence) > 0.25 for f in found)


def test_shared_noise_counts_again_near_the_noise(demo: Any) -> None:
    layout = Layout(demo.joints, (ChosenEffect("coulomb_friction", 1),))
    near = layout.vector(identify(demo, effects=["coulomb_friction:joint2"]).model)
    far = near.copy()
    far[layout.compliance] *= 1.4
    whitening = Whitening(FitContext(demo, layout).two_band)
    points = [whitening.point(x) for x in (far, 1.2 * far, near)]
    assert points[1].chi.mean() > ESTIMATION.far_above_noise > points[2].chi.mean()
    assert not np.any(points[1].bias) and np.any(points[2].bias)
