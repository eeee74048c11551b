"""Search backwards: what makes way for what, and which small effects stay."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from flexviz.diagnosis.many_effects import ManyEffects
from flexviz.diagnosis.rich_result import verdict_on
from flexviz.diagnosis.rich_search import RichSearch

from flexviz.diagnosis import diagnose, elimination, many_effects, model_family, what_is_left
from flexviz.diagnosis.elimination import Elimination, Necessity, eliminate, necessities
from flexviz.diagnosis.model_family import RichModel
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.motion_samples import Phase
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import ScoredCandidate
from flexviz.measurements import MeasurementSet, read_set
from flexviz.parallel import Background, on_cores, stopped_by
from flexviz.results import Verdict
from tests.planar_arm import HELD_OUT, planar_set

LIMITS = THRESHOLDS.motion
DEMO = Path(__file__).parents[1] / "sessions" / "planar-2r-demo"
COULOMB, STRIBECK = ChosenEffect("coulomb_friction", 1), ChosenEffect("stribeck_friction", 1)
CURVE = ChosenEffect("free_curve_velocity", 1)
PRESLIDING = ChosenEffect("presliding_hysteresis", 1)
GAIN, CONTACT = ChosenEffect("torque_gain", 1), ChosenEffect("external_contact", 1, group="fit")
SPRING, COMPENSATOR = ChosenEffect("cable_spring", 1), ChosenEffect("gravity_compensator", 1)


def search_of(measurements: MeasurementSet) -> RichSearch:
    own = Layout(measurements.joints)
    standing = Standing(own, PredictionErrorBand(measurements), None)
    return RichSearch(MotionContext(measurements, own.joints), own, lambda _: None, standing)


def fitted(search: RichSearch, *effects: tuple[ChosenEffect, list[float]]) -> MotionFit:
    layout = Layout(search.own.joints, tuple(effect for effect, _ in effects))
    x = search.context.start(layout).x.copy()
    for effect, values in effects:
        x[layout.effect_slice(effect)] = values
    return search.fit(layout, x)


def beside_the_truth(search: RichSearch, *effects: tuple[ChosenEffect, list[float]]) -> MotionFit:
    """A model evaluated with these values, the others from a fit with what is hidden."""
    whole = fitted(search, (COULOMB, [3.0]))
    layout = Layout(search.own.joints, tuple(effect for effect, _ in effects))
    x = layout.vector(whole.layout.model(whole.x))
    for effect, values in effects:
        x[layout.effect_slice(effect)] = values
    return search.fit(layout, x, iterations=0)


@pytest.fixture(scope="module")
def demo() -> RichSearch:
    """Of the demonstration, which hides Coulomb friction of 3 Nm on joint 2."""
    return search_of(read_set(DEMO))


@pytest.fixture(scope="module")
def sprung(tmp_path_factory: pytest.TempPathFactory) -> RichSearch:
    """A spring with a rest angle beside friction that follows the load, the spring's torque included."""
    friction = "load_dependent_friction:joint2:coefficient=0.1"
    hidden = ("cable_spring:joint2:stiffness=9,rest_angle=0.6", friction)
    return search_of(planar_set(tmp_path_factory.mktemp("sprung") / "arm", hidden, 5, groups=HELD_OUT))


def test_stribeck_friction_up_to_the_top_speed_becomes_coulomb_friction(demo):
    fast = fitted(demo, (STRIBECK, [3.0, 2.5]))
    result = eliminate(fast)
    assert result.dropped.keys() == {STRIBECK} and result.dropped[STRIBECK].implausible and not result.kept
    fit, needed = demo.thinned(fast)
    assert set(needed) == {COULOMB}
    assert fit.x[fit.layout.effect_slice(COULOMB)][0] == pytest.approx(3.0, rel=0.01)


def test_presliding_over_no_angle_becomes_coulomb_friction(demo):
    """It had been dropped with all of the joint's friction."""
    stiff = beside_the_truth(demo, (PRESLIDING, [1e7, 3.0]))
    assert eliminate(stiff).dropped[PRESLIDING].implausible
    fit, needed = demo.thinned(stiff)
    assert set(needed) == {COULOMB}
    assert fit.x[fit.layout.effect_slice(COULOMB)][0] == pytest.approx(3.0, rel=0.01)


def test_an_effect_is_not_lost_to_rounding_beside_one_that_is_nearly_the_same(demo):
    """Variances of 1e12 Nm² of two effects of which only the sum is known, to 1 mNm."""
    twin = ChosenEffect("link_coulomb_friction", 1)
    fit = beside_the_truth(demo, (COULOMB, [3.0]), (twin, [1e-3]))
    alone = eliminate(fit)
    assert set(alone.kept) == {COULOMB}
    apart = np.zeros(fit.layout.size)
    apart[[fit.layout.effect_slice(e).start for e in (COULOMB, twin)]] = 1.0, -1.0
    matrix = fit.covariance.matrix + 1e12 * np.outer(apart, apart)
    fit.__dict__["covariance"] = replace(fit.covariance, matrix=matrix)
    result = eliminate(fit)
    assert set(result.kept) == {COULOMB}
    assert result.kept[COULOMB].deviations == pytest.approx(alone.kept[COULOMB].deviations, rel=0.3)
    assert result.x == pytest.approx(alone.x, rel=1e-3, abs=1e-6)


def test_what_the_data_do_not_show_leaves_nothing_in_its_place(demo):
    slow = fitted(demo, (COULOMB, [3.0]), (ChosenEffect("stribeck_friction", 0), [1e-4, 2.9]))
    assert not any(need.implausible for need in eliminate(slow).dropped.values())
    assert set(demo.thinned(slow)[1]) == {COULOMB}


def test_nothing_stands_in_for_an_impossible_law_beside_one_that_replaces_it(demo, monkeypatch):
    """Presliding hysteresis holds the Coulomb friction that would stand for Stribeck friction."""
    fast = fitted(demo, (STRIBECK, [3.0, 2.5]), (PRESLIDING, [1.0, 0.01]))
    needed = Necessity(50.0, 2.0, 0.1, 0.5, 0.5, credible=True, quiet=True, at_noise=True)
    both = {PRESLIDING: needed, STRIBECK: replace(needed, credible=False)}
    assert both[STRIBECK].implausible

    def once(fit: MotionFit, _: frozenset[ChosenEffect]) -> Elimination:
        have = {effect: both[effect] for effect in fit.layout.effects}
        impossible = {e: need for e, need in have.items() if need.implausible}
        return Elimination({e: need for e, need in have.items() if need.credible}, impossible, fit.x)

    monkeypatch.setattr(model_family, "eliminate", once)
    assert set(demo.thinned(fast)[1]) == {PRESLIDING}


def test_a_rise_over_two_stretches_has_no_known_error(demo, monkeypatch):
    fit = fitted(demo, (COULOMB, [3.0]))
    assert np.isfinite(eliminate(fit).kept[COULOMB].rise_error)
    monkeypatch.setattr(elimination, "_stretches", lambda _: [slice(0, 100), slice(100, 200)])
    kept = eliminate(fit, frozenset({COULOMB})).kept[COULOMB]
    assert kept.rise_error == np.inf and kept.held_out_rise > 0 and not kept.completes


@pytest.mark.parametrize(
    ("at_noise", "rise", "error", "needed"),
    [(True, 2.0, 0.5, True), (False, 2.0, 0.5, False), (True, 1.2, 0.5, False), (True, 0.5, 0.1, False)],
)
def test_a_small_effect_stays_if_only_it_brings_its_joint_to_the_noise(at_noise, rise, error, needed):
    small = 0.5 * LIMITS.least_torque_share
    need = Necessity(50.0, rise, error, small, small, credible=True, quiet=True, at_noise=at_noise)
    assert need.needed == needed


def test_at_the_noise_is_a_joint_with_all_that_acts_on_it(demo):
    whole, without = fitted(demo, (COULOMB, [3.0])), fitted(demo, (ChosenEffect("torque_offset", 1), [0.1]))
    assert eliminate(whole).kept[COULOMB].at_noise
    assert without.rms[1] > 10 * demo.context.noise_floor[1]
    kept = eliminate(without, frozenset(without.layout.effects)).kept
    assert not kept[ChosenEffect("torque_offset", 1)].at_noise


def test_an_effect_of_the_whole_robot_is_at_the_noise_with_most_joints(demo):
    delay = ChosenEffect("torque_delay", None)
    for beside, expected in (([(COULOMB, [3.0])], True), ([], False)):
        fit = fitted(demo, *beside, (delay, [1e-4]))
        assert eliminate(fit, frozenset({delay})).kept[delay].at_noise == expected
        assert bool(np.median(fit.rms / demo.context.noise_floor) < 2.0) == expected


def test_a_spring_keeps_its_place_where_friction_follows_its_load(sprung):
    """As an offset of the motor torque its preload would add no load: a gravity compensator fits better."""
    friction, offset = ChosenEffect("load_dependent_friction", 1), ChosenEffect("torque_offset", 1)
    start = sprung.context.start(Layout(sprung.own.joints, (SPRING,)))
    held = start.x[-1]
    fit = fitted(sprung, (friction, [0.1]), (SPRING, [9.0, held]), (offset, [9.0 * (held - 0.6)]))
    floor = sprung.context.noise_floor
    assert fit.rms[1] > 2 * floor[1]
    found, needed = sprung.refined(*sprung.thinned(fit))
    assert SPRING in needed and COMPENSATOR not in needed and offset not in needed
    assert found.rms[1] < 1.5 * floor[1]
    stiffness, rest = found.x[found.layout.effect_slice(SPRING)]
    np.testing.assert_allclose((stiffness, rest), (9.0, 0.6), rtol=0.01)


def test_a_gravity_compensator_gives_its_place_back_to_a_spring(sprung):
    friction = ChosenEffect("load_dependent_friction", 1)
    fit = fitted(sprung, (friction, [0.1]), (COMPENSATOR, [9.0, 3.0]))
    found, needed = sprung.with_original_laws(*sprung.thinned(fit))
    assert SPRING in needed and COMPENSATOR not in needed
    np.testing.assert_allclose(found.x[found.layout.effect_slice(SPRING)], (9.0, 0.6), rtol=0.01)


@pytest.mark.parametrize("cores", [1, 2])
def test_where_all_candidates_together_do_not_help_the_clear_ones_are_tried_alone(demo, monkeypatch, cores):
    plain = fitted(demo)
    chosen = [s for s in demo.scores(plain) if s.effect.effect in ("coulomb_friction", "cable_spring")][:2]
    assert chosen[0].effect == COULOMB
    tried: list[int] = []
    better = demo.if_better

    def alone(fit, larger, added):
        tried.append(len(added))
        return better(fit, larger, added) if len(added) == 1 else None

    monkeypatch.setattr(demo, "if_better", alone)
    with on_cores(cores):
        found = demo.enlarged(plain, chosen)
    assert tried == [2, 1] and found is not None and set(found[1]) == {COULOMB}


@pytest.mark.parametrize(("gain", "chosen"), [(-0.999, False), (-0.3, True), (0.1, True)])
def test_no_candidate_is_a_drive_gain_that_cannot_be(demo, gain, chosen):
    """Or one so large that far more than the noise would be left if it were missing."""
    scored = [ScoredCandidate(GAIN, 1e6, np.array([gain]), np.zeros(0))]
    assert bool(demo.best_of_each_joint(demo.bare, scored)) == chosen
    near = replace(demo.bare)
    near.__dict__["rms"] = 4 * demo.context.noise_floor
    assert bool(demo.best_of_each_joint(near, scored)) == (gain == 0.1)


def test_a_drive_gain_far_beyond_data_sheets_needs_a_model_that_reaches_the_noise(tmp_path, demo):
    """A real arm's base got a gain of -0.3 at 4 times its noise."""
    for gain, believed in ((0.3, False), (0.1, True)):
        imitated = beside_the_truth(demo, (COULOMB, [3.0]), (GAIN, [gain]))
        assert imitated.rms[1] > LIMITS.small_left * demo.context.noise_floor[1]
        assert necessities(imitated)[GAIN].credible == believed
    wrong = search_of(
        planar_set(tmp_path / "arm", ("torque_gain:joint2:gain_error=0.25",), 5, groups=HELD_OUT)
    )
    fit, needed = wrong.thinned(fitted(wrong, (GAIN, [0.1])))
    assert set(needed) == {GAIN}
    assert fit.x[fit.layout.effect_slice(GAIN)][0] == pytest.approx(0.25, rel=0.02)


@pytest.mark.parametrize(
    ("new", "rise", "worse"),
    [(COULOMB, 1.08, False), (COULOMB, 1.12, True), (CONTACT, 1.08, True), (CONTACT, 1.04, False)],
)
def test_an_episode_may_make_hardly_anything_worse(demo, new, rise, worse):
    """Contacts that no held-out group confirms made a real arm's wrist worse by a tenth, one by one."""
    held_out = 50 * demo.context.noise_floor

    def model(*effects: ChosenEffect, factor: float = 1.0) -> MotionFit:
        after = held_out * np.array([1.0, factor])
        return cast(
            MotionFit,
            SimpleNamespace(layout=Layout(demo.own.joints, effects), held_out_rms=lambda: after),
        )

    assert demo.worse_joints(model(), model(new, factor=rise)) == ({1} if worse else set())


def test_a_joint_that_rests_all_the_time_has_no_error(demo, monkeypatch):
    """Its standstill is judged apart, and nothing else of it is left."""
    context = search_of(read_set(DEMO)).context
    context.first_phase[0] = Phase.MOTION
    for name in ("_phases", "judged_phases"):
        monkeypatch.setitem(
            context.__dict__, name, np.minimum(getattr(context, name), [Phase.REST, Phase.MOTION])
        )
    layout = Layout(demo.own.joints)
    fit = context.fit(layout, context.start(layout).x)
    assert fit.rms[0] == fit.held_out_rms()[0] == 0
    assert fit.rms[1] > 0 and np.isfinite(fit.sigma).all() and np.isfinite(fit.objective)


def test_after_a_free_curve_the_search_begins_anew(demo, monkeypatch):
    """Candidates that were refused beside an unknown law are tried again beside its curve."""
    plain = fitted(demo)
    leading = [s for s in demo.scores(plain) if s.effect == COULOMB]
    laws = iter([None, None, CURVE])
    tried: list[bool] = []
    monkeypatch.setattr(demo, "keep", lambda *_: None)
    monkeypatch.setattr(demo, "scores", lambda _: leading)
    monkeypatch.setattr(demo, "best_of_each_joint", lambda _fit, _scores: leading)
    monkeypatch.setattr(demo, "unknown", lambda _fit, _chosen: next(laws, None))
    monkeypatch.setattr(demo, "beside_curve", lambda fit, _: (fit, {}))
    monkeypatch.setattr(demo, "enlarged", lambda *_: tried.append(COULOMB in demo._refused))
    try:
        demo.with_all_found(plain, {})
    finally:
        demo._refused = set()
    assert tried == [False, True, False, True]


@pytest.mark.parametrize(
    ("shares", "found"),
    [({1: 0.4}, 1), ({1: 0.2}, None), ({0: 0.5}, None), ({0: 0.9}, 0), ({0: 0.9, 1: 0.4}, 1)],
)
def test_a_law_of_no_library_elsewhere_than_where_most_is_left_leads_by_far(demo, monkeypatch, shares, found):
    """The best candidate of joint 1 explains 10 % of what is left there; most is left on joint 2."""
    fit = fitted(demo)
    assert np.argmax(fit.rms / demo.context.noise_floor) == 1
    monkeypatch.setattr(
        what_is_left,
        "best_curve",
        lambda fit, joint: (
            ChosenEffect("free_curve_velocity", joint),
            shares.get(joint, 0.0) * len(fit.weights),
        ),
    )
    monkeypatch.setattr(LIMITS.__class__, "far_off", 0.0)
    score = ScoredCandidate(
        ChosenEffect("torque_offset", 0), 0.1 * len(fit.weights), np.zeros(1), np.zeros(1)
    )
    curve = demo.unknown(fit, [score])
    assert (curve and curve.joint) == found


def test_a_search_stopped_with_a_curve_alone_ends_with_the_sets_own_model(monkeypatch):
    """Nothing is fitted any more to see whether the curve would do alone."""
    stops: list[bool] = []

    def run(search: RichSearch, _: RichModel) -> RichModel:
        fit = search.fit(Layout(search.own.joints, (COULOMB, CURVE)), fitted_start(search))
        search.curves = (CURVE,)
        search.keep(fit, {})
        stops.append(True)
        search.say("")
        raise AssertionError("it does not stop")

    def fitted_start(search: RichSearch) -> np.ndarray:
        return search.context.start(Layout(search.own.joints, (COULOMB, CURVE))).x.copy()

    monkeypatch.setattr(RichSearch, "near_noise", lambda _: None)
    monkeypatch.setattr(RichSearch, "hides_many", lambda *_: True)
    monkeypatch.setattr(RichSearch, "run", run)
    result = diagnose(read_set(DEMO), apply=True, should_stop=lambda: bool(stops))
    assert result.stopped and len(result.steps) == 1
    assert result.model is not None and not result.model.effects


def many_effects_of(search: RichSearch) -> ManyEffects:
    measurements, own = search.context.measurements, search.own
    band = PredictionErrorBand(measurements)
    return ManyEffects(measurements, own, band, lambda _: None, Standing(own, band, None))


def test_small_effects_may_remain_only_in_a_complete_model(demo):
    """Of a model that something explains, or that nothing does, the verdict says what is left."""
    fit = replace(fitted(demo, (COULOMB, [3.0])))
    fit.__dict__["rms"] = demo.context.noise_floor * np.sqrt(LIMITS.small_left * LIMITS.unexplained)
    many = many_effects_of(demo)
    verdicts: tuple[tuple[Verdict, bool], ...] = (
        ("nothing-missing", True),
        ("unknown", False),
        ("missing", False),
    )
    for last, expected in verdicts:
        notes = many.remarks(fit, (), last)
        assert any("no candidate explains it" in note.text for note in notes) == expected
    assert not any("no candidate" in note.text for note in many.remarks(fit, (CURVE,), "nothing-missing"))


@pytest.mark.parametrize(
    ("noises", "share", "expected"),
    [
        (1.5, 0.5, "nothing-missing"),  # the noise is most of the torque
        (5.0, 0.01, "nothing-missing"),
        (5.0, 0.5, "unknown"),
        (20.0, 0.01, "unknown"),
    ],
)
def test_what_is_left_is_much_of_the_torque_or_many_times_the_noise(
    demo: RichSearch, noises: float, share: float, expected: Verdict
) -> None:
    fit = replace(fitted(demo, (COULOMB, [3.0])))
    fit.__dict__["rms"] = noises * demo.context.noise_floor
    fit.__dict__["_held_out_rms"] = share * demo.context.spread
    assert verdict_on(RichModel(fit, {})) == expected


def test_a_stop_during_the_staircase_does_not_discard_what_copies_do(demo, monkeypatch):
    """The result is complete by then: a copy's work would only be done once more."""
    fit = fitted(demo, (COULOMB, [3.0]))
    stops: list[bool] = []
    done_by: list[int] = []
    real = many_effects.staircase

    def slow_copy() -> int:
        time.sleep(0.3)
        return os.getpid()

    def stopped_within(*args):
        work = Background(slow_copy)
        stops.append(True)
        done_by.append(work.result())
        return real(*args)

    monkeypatch.setattr(many_effects, "staircase", stopped_within)
    with on_cores(2), stopped_by(lambda: bool(stops)):
        result = many_effects_of(demo).result(
            RichModel(fit, eliminate(fit).kept), True, True, False, lambda _: None
        )
    assert [step.verdict for step in result.steps] == ["missing", "nothing-missing"]
    assert done_by[0] != os.getpid()


def test_two_effects_that_were_only_found_together_stay_if_they_explain_everything(demo):
    """Beside a spring the search has an offset, too: what it ends with may have fewer effects than it had."""
    many = many_effects_of(demo)
    whole, without = fitted(demo, (COULOMB, [3.0])), fitted(demo, (ChosenEffect("torque_offset", 1), [0.1]))
    need = Necessity(50.0, 2.0, 0.1, 0.5, 0.5, credible=True, quiet=True, at_noise=True)
    both = RichModel(whole, {COULOMB: need, SPRING: need})
    assert many.useful(both) is both
    assert many.useful(RichModel(whole, {COULOMB: need})) is None
    assert many.useful(RichModel(without, {COULOMB: need, SPRING: need})) is None
