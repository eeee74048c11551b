"""The diagnosis' parts: projections, looked-up pulses, judging, model errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flexviz.diagnosis.comparison import CandidateScores, RefittedCandidate, SearchStep
from flexviz.diagnosis.confidence import features, probability
from flexviz.diagnosis.evidence import telling_motion
from flexviz.diagnosis.forward_search import ForwardSearch
from flexviz.diagnosis.free_curve_test import best_free_curve
from flexviz.diagnosis.many_effects import ManyEffects
from flexviz.diagnosis.pipeline import Interrupted, _Pipeline
from flexviz.diagnosis.rich_search import RichSearch

from flexviz.diagnosis import diagnose
from flexviz.diagnosis.acceptance import Gained, credible, excess, needed_gain, verdict
from flexviz.diagnosis.candidates import with_effect, without_effect
from flexviz.diagnosis.elimination import Necessity
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Equation, Layout, build_signals
from flexviz.estimation import ESTIMATION, TrackingWhitening
from flexviz.estimation.noise_propagation import NoiseDerivatives
from flexviz.estimation.score_test import Projection, ScoredCandidate, explained
from flexviz.estimation.whitening import lagged_covariance, noise_kernel, whitener
from flexviz.identification import identify
from flexviz.measurements import read_set
from flexviz.observers import FlatZeroPhase

KUKA = Path(__file__).resolve().parents[2] / "shared" / "real" / "kuka_kr300"


@pytest.fixture(scope="module")
def base(demo: Any) -> tuple[FitContext, Fit]:
    layout = Layout(demo.joints)
    fit_context = FitContext(demo, layout)
    return fit_context, fit_context.fit(layout, layout.vector(identify(demo).model), iterations=12)


def test_projection_agrees_with_taking_it_out_explicitly() -> None:
    rng = np.random.default_rng(0)
    z, h, r = rng.standard_normal((200, 5)), rng.standard_normal((200, 3)), rng.standard_normal(200)
    h[:50] = 0.0
    hessian = z.T @ z + np.diag([0.0, 1.0, 2.0, 0.0, 3.0])
    projection = Projection(r, z, hessian)
    left = h - z @ np.linalg.solve(hessian, z.T @ h)
    np.testing.assert_allclose(projection.rest(h[50:], slice(50, 200)), left, atol=1e-12)
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
    dense = np.zeros((count, n, count, n))
    for t in range(count):
        for k in range(t + 1):
            dense[t, :, t - k] = lagged[k, t]
            dense[t - k, :, t] = lagged[k, t].T
    matrix = dense.reshape(count * n, count * n)
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


def test_fewer_samples_of_smooth_columns_suffice(demo: Any) -> None:
    signals = build_signals(demo, demo.groups[:1], FlatZeroPhase(2 * np.pi * 6))
    equation = Equation(demo.robot, signals, Layout(demo.joints))
    context = equation.at(equation.layout.vector(identify(demo).model)).context
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


def test_residual_alone_is_the_residual(demo: Any) -> None:
    signals = build_signals(demo, demo.groups[:2], FlatZeroPhase(2 * np.pi * 6))
    for names in ((), (ChosenEffect("coulomb_friction", 1),), (ChosenEffect("presliding_hysteresis", 0),)):
        layout = Layout(demo.joints, names)
        equation = Equation(demo.robot, signals, layout)
        x = np.zeros(layout.size)
        x[: layout.effect_start] = Layout(demo.joints).vector(identify(demo).model)
        x[layout.effect_start :] = 2.0
        seen = equation.at(x)
        np.testing.assert_allclose(seen.residual(x), seen.evaluate(x).residual, atol=1e-9)


def test_a_free_curve_takes_what_friction_takes_but_not_the_other_joint(base: tuple[FitContext, Fit]) -> None:
    fit_context, fit = base
    search = Search(fit_context, lambda text: None)
    scores = search.scores(fit)
    weigh = search.weigh(fit)
    coulomb = next(s for s in scores.ranked if s.effect == ChosenEffect("coulomb_friction", 1))
    assert scores.ranked[0] is coulomb
    right = best_free_curve(fit_context, fit, 1, weigh, scores.projection)
    wrong = best_free_curve(fit_context, fit, 0, weigh, scores.projection)
    assert right.variable in ("velocity", "position × direction")
    assert coulomb.gain == pytest.approx(right.gain, rel=0.1)
    assert wrong.gain < 0.5 * right.gain


def test_what_is_judged(base: tuple[FitContext, Fit]) -> None:
    fit = base[1]
    effect = ChosenEffect("torque_gain", 0)

    def with_value(effect: ChosenEffect, value: float) -> Fit:
        start = with_effect(fit.layout, fit.x, effect, np.array([value]))
        layout, x = start.layout, start.x
        return replace(fit, layout=layout, x=x)

    gain = EFFECTS["torque_gain"]
    assert gain.at_bound(np.array([-0.8])) and not gain.at_bound(np.array([-0.1]))
    assert credible(with_value(effect, -0.1), effect, 1e-3)
    assert not credible(with_value(effect, -0.6), effect, 1e-3)
    delay = ChosenEffect("torque_delay")
    assert credible(with_value(delay, 5e-4), delay, 1e-3)
    assert not credible(with_value(delay, 1e-5), delay, 1e-3)  # a hundredth of the record's step
    before, elsewhere = Gained(1e5, np.array([1e5, 0.0])), Gained(1e5, np.array([0.0, 1e5]))
    assert needed_gain(effect, elsewhere) < needed_gain(effect, before)
    contact = ChosenEffect("external_contact", 0, "g1")
    assert needed_gain(contact, before) == needed_gain(contact, elsewhere) > needed_gain(effect, before)
    tilt = ChosenEffect("base_tilt")
    assert needed_gain(tilt, elsewhere) == needed_gain(effect, before)
    assert needed_gain(tilt, Gained(2e5, np.array([1e5, 1e5]))) == needed_gain(tilt, before)
    assert excess(fit) > 10 and verdict(fit, fit) == "unknown"


@pytest.mark.parametrize("effects, noise, more", [((), 1.3, 3.2), (("coulomb_friction",), 2.6, 4.5)])
def test_one_joint_of_an_arm_may_be_structured_where_the_mean_is_not(
    effects: tuple[str, ...], noise: float, more: float
) -> None:
    layout = Layout(tuple("abcdefg"), tuple(ChosenEffect(name, 1) for name in effects))

    def bare(chi: float) -> Any:
        values = np.append(np.full(6, 1.05), chi)
        return SimpleNamespace(chi=values, chi_held_out=values, layout=layout)

    limits = THRESHOLDS.acceptance
    assert excess(bare(more)) < (limits.structured_excess if effects else limits.structured_excess_smooth)
    assert verdict(bare(more), bare(more)) == "unknown"
    assert verdict(bare(noise), bare(noise)) == "nothing-missing"


@pytest.mark.parametrize(
    "effect, before, expected",
    [
        ("joint_damping", 1.2, "unknown"),
        ("joint_damping", 2e3, "nothing-missing"),
        ("backlash", 1.2, "nothing-missing"),
    ],
)
def test_effects_without_reversals_leave_little(effect: str, before: float, expected: str) -> None:
    """Two imitations of a wobbling mass left three quarters of what was missing."""

    def model(left: float, effects: tuple[ChosenEffect, ...]) -> Any:
        values = np.full(2, 1 + left)
        return SimpleNamespace(chi=values, chi_held_out=values, layout=Layout(("a", "b"), effects))

    assert verdict(model(0.9, (ChosenEffect(effect, 0),)), model(before, ())) == expected


def test_a_refined_law_has_to_earn_its_freedom(base: tuple[FitContext, Fit]) -> None:
    fit_context, fit = base
    search = Search(fit_context, lambda _: None)

    def tried(effect: str, joint: int, objective: float) -> RefittedCandidate:
        scored = ScoredCandidate(ChosenEffect(effect, joint), 1.0, np.zeros(1), np.zeros(1))
        return RefittedCandidate(scored, replace(fit, objective=objective))

    refined, simple = tried("presliding_hysteresis", 1, 100.0), tried("coulomb_friction", 1, 105.0)
    assert search.simplest([refined, simple]) is simple
    worse = tried("coulomb_friction", 1, 100.0 + 2 * THRESHOLDS.acceptance.nested_gain)
    assert search.simplest([refined, worse]) is refined
    assert search.simplest([refined, tried("coulomb_friction", 0, 105.0)]) is refined
    assert search.simplest([refined, tried("backlash", 1, 105.0)]) is refined


def test_an_effect_that_only_led_out_of_a_wrong_place_is_not_needed(
    demo: Any, base: tuple[FitContext, Fit]
) -> None:
    """A fit that ended with a wrong stiffness, and an effect whose fit found the right one."""
    fit_context, _ = base
    search = Search(fit_context, lambda _: None)
    layout = Layout(demo.joints, (ChosenEffect("coulomb_friction", 1),))
    right = fit_context.fit(layout, layout.vector(identify(demo, effects=["coulomb_friction:joint2"]).model))
    x = right.x.copy()
    x[layout.compliance] *= 3.0
    stuck = fit_context.fit(layout, x, iterations=0)
    added = with_effect(layout, right.x, ChosenEffect("stiffness_hardening", 0), np.zeros(1))
    with_more, start = added.layout, added.x
    led_out = fit_context.fit(with_more, start, iterations=2)
    scored = ScoredCandidate(ChosenEffect("stiffness_hardening", 0), 1.0, np.zeros(1), np.zeros(1))
    again = search.restarted(stuck, RefittedCandidate(scored, led_out), Gained(0.0, np.zeros(2)))
    assert again is not None and again.layout == layout
    assert again.objective < right.objective + THRESHOLDS.acceptance.least_gain
    # Coulomb friction itself is needed
    plain = Layout(demo.joints)
    without = fit_context.fit(plain, x[: plain.size], iterations=0)
    scored = ScoredCandidate(ChosenEffect("coulomb_friction", 1), 1.0, np.zeros(1), np.zeros(1))
    assert search.restarted(without, RefittedCandidate(scored, right), Gained(0.0, np.zeros(2))) is None


def test_rivals_are_compared_where_the_leader_scores_nothing_and_by_their_best_stretch(
    base: tuple[FitContext, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    fit_context, fit = base
    search = Search(fit_context, lambda _: None)

    def scored(effect: ChosenEffect, gain: float, values: list[float]) -> ScoredCandidate:
        return ScoredCandidate(effect, gain, np.array(values), np.zeros(1))

    friction = scored(ChosenEffect("coulomb_friction", 1), 100.0, [2.0])
    group = fit_context.fit_groups[0].name
    contact = scored(ChosenEffect("external_contact", 1, group), 90.0, [1.0, 2.0, 3.0])
    leader = RefittedCandidate(friction, search.refit(fit, friction, 3).fit)
    elsewhere = scored(contact.effect, 1.0, [0.1, 4.0, 5.0])  # in another stretch of the group
    for ranked in ([contact], [friction, contact, elsewhere]):
        found = CandidateScores(ranked, search.scores(fit, {friction.effect}).projection)
        monkeypatch.setattr(search, "scores", lambda *_, found=found: found)
        compared = search.rivals(fit, leader, [contact])
        monkeypatch.undo()
        assert {friction.effect, contact.effect} <= {r.effect for r in compared.refitted}
        assert not compared.ruled_out


def test_a_stop_while_effects_are_dropped_keeps_what_was_found(
    demo: Any, base: tuple[FitContext, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    context, fit = base
    effects = [ChosenEffect(name, 1) for name in ("torque_offset", "coulomb_friction", "backlash")]
    steps = []
    for effect in effects:
        added = with_effect(fit.layout, fit.x, effect, np.zeros(len(EFFECTS[effect.effect].parameters)))
        before, fit = fit, replace(fit, layout=added.layout, x=added.x)
        scored = ScoredCandidate(effect, 1.0, np.zeros(1), np.zeros(1))
        steps.append(SearchStep(before, RefittedCandidate(scored, fit), {}))
    answers = iter((True, False))  # a stop that is said once
    pipeline = _Pipeline(demo, True, None, None, lambda: next(answers))
    search = ForwardSearch(context, base[1], pipeline.say, lambda fit: None, lambda start: None)
    search.steps = list(steps)
    fewer = without_effect(fit.layout, fit.x, effects[0])
    smaller = replace(fit, layout=fewer.layout, x=fewer.x)
    monkeypatch.setattr(search.search, "without_superfluous", lambda *_: smaller)
    with pytest.raises(Interrupted):
        search.drop_superfluous()
    assert search.steps == steps
    with pytest.raises(Interrupted):
        pipeline.check_stop()


def test_a_stopped_search_backwards_gives_the_best_model_so_far(
    demo: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    effects = [ChosenEffect(name, 1) for name in ("coulomb_friction", "torque_offset", "joint_damping")]
    kept = dict.fromkeys(effects, Necessity(10.0, 1.0, 0.1, 0.1, 0.1, True, False, False))

    def find(many: ManyEffects) -> None:
        layout = Layout(demo.joints, tuple(effects))
        many.search.keep(many.search.fit(layout, many.context.start(layout).x), kept)
        stops.append(True)
        many.say("more of it")

    stops: list[bool] = []
    monkeypatch.setattr(RichSearch, "near_noise", lambda _: None)
    monkeypatch.setattr(ManyEffects, "find", find)
    result = diagnose(demo, should_stop=lambda: bool(stops))
    assert result.stopped and result.verdict == "missing" and len(result.steps) == 1
    assert result.findings[0].text == "coulomb_friction:joint2" and len(result.findings) == 3
    assert result.findings[0].parameters["coulomb"].value == pytest.approx(3.0, rel=0.01)


def test_confidence_follows_what_speaks_for_it() -> None:
    nothing = probability((0.0, 0.5, 0.0))
    assert nothing < probability((6.0, 1.0, 0.0)) <= THRESHOLDS.evidence.max_confidence
    for k, step in enumerate((1.0, 0.2, -1.0)):  # gain, share, and what is left
        more = [6.0, 0.5, 2.0]
        less = list(more)
        less[k] -= step
        assert probability(less) < probability(more)


def judged(objective: float, chi: float, chi_held_out: float) -> Any:
    """A fit of two joints, as far as its confidence depends on it."""
    return SimpleNamespace(objective=objective, chi=np.full(2, chi), chi_held_out=np.full(2, chi_held_out))


def test_a_trace_of_what_an_effect_explains_casts_no_doubt_on_it() -> None:
    """Nor in the held-out groups, unless it explains less of them: an imitation does not predict them."""
    before = judged(1e5, 1e8, 1e8)
    chi = [(250.0, 1.0), (250.0, 250.0), (250.0, 1e6), (1e6, 1.0)]
    traces = [judged(1e4, *each) for each in chi]
    sure, traced, imitating, coarse = (probability(features(before, after, after)) for after in traces)
    assert sure > 0.9 and traced > 0.9 and imitating < 0.1 and coarse < 0.1
    unchecked = judged(1e4, 250.0, np.nan)
    for known in (before, judged(1e5, 1e8, np.nan)):
        assert probability(features(known, unchecked, unchecked)) < 0.1


def test_what_tells_two_effects_apart_is_named(base: tuple[FitContext, Fit]) -> None:
    fit_context, fit = base
    rng = np.random.default_rng(0)
    mine = np.zeros(fit.point.r.shape)
    speed = np.abs(fit_context.two_band.narrow.signals.theta[1, :, 1])
    fast = speed > np.quantile(speed, 0.9)
    mine[fast, 1] = 1.0
    other = mine + 0.0
    other[fast, 1] += rng.standard_normal(fast.sum())
    mine, other = (m.ravel() / np.linalg.norm(m) for m in (mine, other))
    sentence = telling_motion(fit_context, fit, ChosenEffect("coulomb_friction", 1), mine, other)
    assert f"fast motion of {fit.layout.joints[1]}" in sentence
    assert "same" in telling_motion(fit_context, fit, ChosenEffect("coulomb_friction", 1), mine, mine)


def test_errors_of_every_group_add_up(demo: Any, base: tuple[FitContext, Fit]) -> None:
    errors = PredictionErrorBand(demo).errors(base[1])
    assert [name for name, _, _ in errors.groups] == [g.name for g in demo.groups]
    assert [held for _, _, held in errors.groups] == [g.validation for g in demo.groups]
    held_out = [rms for _, rms, held in errors.groups if held]
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
    dry = ("coulomb_friction", "link_coulomb_friction", "stribeck_friction", "presliding_hysteresis")
    assert {joint for effect, joint in added if effect in dry} == set(measurements.joints)
    springs = {joint for effect, joint in added if effect in ("gravity_compensator", "cable_spring")}
    assert springs == {"joint_2"}
    assert any(note.kind == "model-error" for note in result.notes)
    assert any(note.kind == "standstill" for note in result.notes) and result.free_curve is not None
    assert all(s.added.confidence > 0.3 for s in result.steps if s.added is not None)


def test_shared_noise_counts_again_near_the_noise(demo: Any) -> None:
    layout = Layout(demo.joints, (ChosenEffect("coulomb_friction", 1),))
    near = layout.vector(identify(demo, effects=["coulomb_friction:joint2"]).model)
    far = near.copy()
    far[layout.compliance] *= 1.4
    whitening = TrackingWhitening(FitContext(demo, layout).two_band)
    points = [whitening.point(x) for x in (far, 1.2 * far, near)]
    assert points[1].chi.mean() > ESTIMATION.far_above_noise > points[2].chi.mean()
    assert not np.any(points[1].bias) and np.any(points[2].bias)
