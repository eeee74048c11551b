"""What both resolutions offer the search: larger, united, exchanged and smaller models, and their costs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.diagnosis.candidates import alternatives, with_offsets_merged, without
from flexviz.analysis.diagnosis.coarse import Coarse, CoarseModel
from flexviz.analysis.diagnosis.criterion import gain
from flexviz.analysis.diagnosis.fine import Fine, FineModel
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.diagnosis.search import Search
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.diagnosis.unknown_curve import is_curve
from flexviz.analysis.motion import MotionContext
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import DECOYS, EFFECTS, ChosenEffect, kin
from flexviz.model.equation import Layout
from tests.planar_arm import HELD_OUT, planar_set

COULOMB, OFFSET = ChosenEffect("coulomb_friction", 1), ChosenEffect("torque_offset", 0)
STRIBECK, GAIN = ChosenEffect("stribeck_friction", 1), ChosenEffect("torque_gain", 1)
SPRING, DELAY = ChosenEffect("cable_spring", 0), ChosenEffect("torque_delay")
LINK, CURVE = ChosenEffect("link_coulomb_friction", 1), ChosenEffect("free_curve_friction", 1)
HIDDEN = 3.0  # [Nm] of Coulomb friction on joint 2


def coarse_of(measurements: MeasurementSet, own: Layout | None = None) -> Coarse:
    own = own or Layout(measurements.joints)
    return Coarse(MotionContext(measurements, own.joints, stand_ins=True), own, lambda _: None)


def fitted(view: Coarse, *effects: ChosenEffect) -> CoarseModel:
    layout = Layout(view.own.joints, effects)
    return view.fit(layout, view.context.start(layout).x)


def with_values(view: Coarse, **values: list[float]) -> CoarseModel:
    """Effects of joint 2 at these values, not fitted, beside the right friction."""
    whole = fitted(view, COULOMB)
    layout = Layout(view.own.joints, (COULOMB, *(ChosenEffect(name, 1) for name in values)))
    x = layout.vector(whole.layout.model(whole.fit.x))
    for name, value in values.items():
        x[layout.effect_slice(ChosenEffect(name, 1))] = value
    return view.fit(layout, x, iterations=0)


def lowest(models: Iterable[tuple[object, CoarseModel]]) -> CoarseModel:
    return min((model for _, model in models), key=lambda model: model.score.total)


@pytest.fixture(scope="module")
def view(demo: MeasurementSet) -> Coarse:
    """Of the demonstration, which hides Coulomb friction of 3 Nm on joint 2."""
    return coarse_of(demo)


@pytest.fixture(scope="module")
def fine(demo: MeasurementSet) -> Fine:
    own = Layout(demo.joints)
    return Fine(FitContext(demo, own), own, lambda _: None)


@pytest.fixture(scope="module")
def near(fine: Fine, view: Coarse) -> FineModel:
    """The right model in units of the noise."""
    right = fitted(view, COULOMB)
    return fine.begin(right.layout, right.fit.x)


# -- what could be real


def test_a_form_that_the_motion_does_not_show_is_doubtful(view: Coarse) -> None:
    signals, known = view.context.signals, Layout(view.own.joints, (COULOMB,))
    travel, fast = float(np.ptp(signals.theta[0, :, 1])), float(np.abs(signals.theta[1, :, 1]).max())
    two_periods = 4 * np.pi / travel
    for order, doubtful in ((0.95 * two_periods, True), (1.05 * two_periods, False)):
        ripple = ChosenEffect("torque_ripple", 1)
        model = with_values(view, torque_ripple=[0.5, order, 0.3])
        assert view.doubtful(model, known) == ([ripple] if doubtful else [])
    whole = with_values(view, torque_ripple=[1e-4, 0.95 * two_periods, 0.3])
    assert not view.loud(whole).any() and view.doubtful(whole, known) == []  # nothing is left on its joint
    for share, doubtful in ((0.55, True), (0.45, False)):  # half of the top speed is no creeping
        model = with_values(view, stribeck_friction=[0.5, share * fast])
        assert view.doubtful(model, known) == ([STRIBECK] if doubtful else [])
        assert view.doubtful(model, model.layout) == []  # what was there is not asked again


def test_a_parameter_at_its_bound_is_doubtful_and_one_at_zero_is_not(view: Coarse) -> None:
    known = Layout(view.own.joints, (COULOMB,))
    for size, doubtful in ((-0.8, True), (-0.6, False), (0.0, False)):
        model = with_values(view, torque_gain=[size])
        assert view.doubtful(model, known) == ([GAIN] if doubtful else [])
    driving = with_values(view, driving_friction=[0.1, 0.0])
    assert view.doubtful(driving, known) == []  # it costs more than the simpler law, that is all
    curve = with_values(view, free_curve_friction=[0.0] * len(EFFECTS["free_curve_friction"].parameters))
    assert view.doubtful(curve, known) == []


def test_the_sets_own_effects_stay_and_those_beside_which_others_are_defined(demo: MeasurementSet) -> None:
    view = coarse_of(demo, Layout(demo.joints, (OFFSET,)))
    layout = Layout(demo.joints, (OFFSET, COULOMB, GAIN, SPRING))
    assert view.firm(layout) == {OFFSET}
    assert view.firm(Layout(demo.joints, (*layout.effects, STRIBECK))) == {OFFSET, COULOMB}
    offset = ChosenEffect("torque_offset", 1)
    springs = Layout(demo.joints, (offset, ChosenEffect("cable_spring", 1), CURVE))
    assert view.firm(springs) == {OFFSET, offset, CURVE}  # the offset stands for the spring's rest angle
    model = fitted(view, OFFSET, COULOMB)
    assert not list(view.smaller(model))  # the friction is needed, the offset is not in question
    assert view.pruned_of(model, view.own).layout.effects == (OFFSET, COULOMB)


# -- costs


def test_a_spring_and_the_offset_that_stands_for_its_rest_angle_cost_as_one(demo: MeasurementSet) -> None:
    joints, view = demo.joints, coarse_of(demo)
    criterion, offset = view.criterion, ChosenEffect("torque_offset", 0)
    alone, both = Layout(joints, (SPRING,)), Layout(joints, (SPRING, offset))
    chosen = np.log(4)  # of a family of four, whose simplest member is a torque offset
    assert view.cost(alone) == pytest.approx(criterion.cost(2, 1) + chosen)
    assert view.cost(both) == pytest.approx(view.cost(alone))
    assert view.saved(both, SPRING) == pytest.approx(view.cost(both) - criterion.cost(1, 1))
    assert view.saved(both, offset) == pytest.approx(0.0)
    elsewhere = Layout(joints, (SPRING, ChosenEffect("torque_offset", 1)))
    assert view.cost(elsewhere) == pytest.approx(view.cost(alone) + criterion.cost(1, 1))
    own = coarse_of(demo, Layout(joints, (offset,)))  # an offset of the set's own is one in any case
    assert own.cost(both) == pytest.approx(own.criterion.cost(2, 2) + chosen)


def test_costs_of_a_law_an_episode_and_a_curve(view: Coarse) -> None:
    criterion, joints = view.criterion, view.own.joints
    assert view.cost_of(COULOMB) == pytest.approx(criterion.cost(1, 1))
    assert view.cost_of(LINK) == pytest.approx(criterion.cost(1, 1) + np.log(kin(LINK.effect)))
    contact = ChosenEffect("external_contact", 1, view.measurements.fit_groups[0].name)
    assert view.cost_of(contact) == pytest.approx(
        criterion.cost(3, 1) + np.log(THRESHOLDS.search.intervals)  # it may have happened any time
    )
    assert view.cost(Layout(joints, (CURVE,))) == 0.0  # a curve is priced by its fit
    assert fitted(view, CURVE).score.cost > 0
    together = Layout(joints, (COULOMB, GAIN))
    assert view.saved(together, GAIN) == pytest.approx(view.cost_of(GAIN))
    size = 0.1
    surprised = (
        with_values(view, torque_gain=[size]).score.cost - with_values(view, torque_gain=[0.0]).score.cost
    )
    assert surprised == pytest.approx(0.5 * (size / 0.05) ** 2)  # drives are right within 5 %


def test_a_model_is_judged_in_recorded_torques(demo: MeasurementSet) -> None:
    """All of a robot 1 + g as large describes a torque scaled by 1 + g: shrinking both gains nothing.

    Only known payloads would tell the two apart.
    """
    unknown = tuple(replace(group, bodies=()) for group in demo.groups)
    view = coarse_of(replace(demo, groups=unknown))
    bare, gains = view.begin(), tuple(ChosenEffect("torque_gain", j) for j in (0, 1))
    layout = Layout(view.own.joints, gains)
    base = layout.vector(bare.layout.model(bare.fit.x))
    for factor in (0.5, 1.3):
        x = base.copy()
        for part in (layout.inertial, layout.motor_inertia, layout.link_viscous, layout.motor_viscous):
            x[part] *= factor
        x[layout.compliance] /= factor
        x[layout.effect_start :] = factor - 1
        model = view.fit(layout, x, iterations=0)
        np.testing.assert_allclose(np.std(model.fit.residual) / np.std(bare.fit.residual), factor, rtol=1e-6)
        np.testing.assert_allclose(model.score.deviation, bare.score.deviation, rtol=1e-6)
        assert gain(bare.score, model.score).delta < -2 * view.cost_of(gains[0])


# -- larger models


def test_kinds_of_moves(view: Coarse, fine: Fine) -> None:
    assert list(view.stages) == ["add", "swap", "episode", "unknown"]
    assert list(fine.stages) == ["add", "episode"]


def test_the_best_scored_effect_makes_its_joint_quiet(view: Coarse) -> None:
    bare = view.begin()
    assert view.loud(bare)[1] and view.significant(bare)[1]
    tried = list(view.larger(bare))
    assert any(place == 1 and view.parts(model) == {COULOMB} for place, model in tried)
    best = lowest((p, m) for p, m in tried if p == 1)
    assert gain(bare.score, best.score).accepted and not view.loud(best)[1]
    # no more than that is tried on it, and nothing where no joint is loud
    assert [view.parts(m) for p, m in tried if p == 1][-1] == view.parts(best)
    right = fitted(view, COULOMB)
    assert not view.loud(right).any() and not view.significant(right).any()
    assert not view.above(right).any() and view.above(bare)[1] > 100
    assert not list(view.larger(right)) and not list(view.episodes(right)) and not list(view.unknowns(right))


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Coarse:
    """Dry friction and an offset of joint 1, dry friction of joint 2."""
    hidden = [
        "coulomb_friction:joint1:coulomb=2",
        "torque_offset:joint1:offset=2",
        "coulomb_friction:joint2:coulomb=1",
    ]
    return coarse_of(planar_set(tmp_path_factory.mktemp("two") / "set", hidden, 5, groups=HELD_OUT))


TWO = {ChosenEffect("coulomb_friction", 0), OFFSET}


def test_a_loud_joint_also_gets_its_plain_model_of_which_the_needed_stays(two: Coarse) -> None:
    bare = two.begin()
    tried = list(two.larger(bare))
    first = [two.parts(model) for place, model in tried if place == 0]
    assert TWO in first  # of dry and load-dependent friction, offset and spring
    assert all(len(some) == 1 for some in first if some != TWO) and len(first) > 1
    assert two.parts(lowest((p, m) for p, m in tried if p == 0)) == TWO
    # together with what joint 2 adds, the model is complete
    ends = [lowest((p, m) for p, m in tried if p == joint) for joint in (0, 1)]
    together = two.united(bare, ends)
    assert together.score.total < min(end.score.total for end in ends)
    assert Search(two).run(bare).score.total <= together.score.total + 1e-6


def test_united_models_have_what_each_has_more_or_instead(two: Coarse) -> None:
    friction = tuple(ChosenEffect("coulomb_friction", j) for j in (0, 1))
    base = fitted(two, LINK)
    one, other = fitted(two, LINK, friction[0]), fitted(two, friction[1])
    together = two.united(base, [one, other])
    assert together.layout.effects == friction
    assert two.united(base, [one]).layout.effects == (LINK, friction[0])


def test_what_is_doubtful_does_not_get_into_united_models(view: Coarse) -> None:
    ripple, offset = ChosenEffect("torque_ripple", 1), ChosenEffect("torque_offset", 1)
    joined = view.united(view.begin(), [fitted(view, ripple), fitted(view, offset)])
    assert view.loud(joined)[1] and view.parts(joined) == {offset}


def test_decoys_are_candidates_when_they_are_asked_for(view: Coarse, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, choices = set(view.wanted(view.own)), view.choices
    assert not any(e.effect in DECOYS for e in plain) and COULOMB in plain
    monkeypatch.setattr(view, "decoys", True)
    more = set(view.wanted(view.own)) - plain
    assert more == {ChosenEffect(name, joint) for name in DECOYS for joint in (0, 1)}
    assert view.choices == choices + len(more)  # they cost what others would
    one = ChosenEffect("decoy_other_joint", 1)
    assert one not in view.wanted(Layout(view.own.joints, (one,)))
    scored = {s.effect for s in view.scores(view.begin().fit, view.wanted(view.own))}
    assert more <= scored


# -- rivals


def test_alternatives_are_of_the_family_or_refine_one_another() -> None:
    assert {"link_coulomb_friction", "presliding_hysteresis"} <= set(alternatives("coulomb_friction"))
    assert {"driving_friction", "torque_gain"} <= set(alternatives("load_dependent_friction"))
    for name in ("coulomb_friction", "torque_offset", "backlash"):
        found = list(alternatives(name))
        assert name not in found
        assert all(EFFECTS[e].scope == "joint" and EFFECTS[e].beside is None for e in found)


def test_a_law_is_exchanged_for_the_right_one_and_not_the_other_way(view: Coarse) -> None:
    wrong, right = fitted(view, LINK), fitted(view, COULOMB)
    rivals = list(view.rivals(wrong))
    best = lowest(rivals)
    assert {place for place, _ in rivals} == {1} and all(LINK not in view.parts(m) for _, m in rivals)
    assert view.parts(best) == {COULOMB} and gain(wrong.score, best.score).accepted
    assert not any(gain(right.score, model.score).accepted for _, model in view.rivals(right))
    own = coarse_of(view.measurements, Layout(view.own.joints, (LINK,)))
    assert not list(own.rivals(own.begin()))  # the set's own model is not in question


def test_friction_by_load_and_a_gain_may_be_driving_friction(view: Coarse) -> None:
    by_load = ChosenEffect("load_dependent_friction", 1)
    model = fitted(view, COULOMB, by_load, GAIN)
    merged = [view.parts(m) for _, m in view.rivals(model) if len(view.parts(m)) < 3]
    assert merged == [{COULOMB, ChosenEffect("driving_friction", 1)}]


# -- smaller models


def test_smaller_models_come_with_the_least_needed_effect_first(
    view: Coarse, near: FineModel, fine: Fine
) -> None:
    offset, quadratic = ChosenEffect("torque_offset", 1), ChosenEffect("quadratic_friction", 0)
    model = fitted(view, COULOMB, offset, quadratic)
    tried = list(view.smaller(model))
    gone = [set(model.layout.effects) - view.parts(m) for m in tried]
    needs = view.gains(model)
    assert gone == [{e} for e in sorted((offset, quadratic), key=lambda e: needs[e].delta)]
    assert all(gain(model.score, m.score).accepted for m in tried)
    assert [set(model.layout.effects) - view.parts(m) for m in view.smaller(model, [offset])] == [{offset}]
    assert view.parts(Search(view).pruned(model)) == {COULOMB}
    layout = Layout(view.own.joints, (COULOMB, offset))
    larger = fine.refit(near, layout, layout.vector(near.layout.model(near.fit.x)))
    assert fine.parts(Search(fine).pruned(larger)) == {COULOMB}
    assert without(layout, [COULOMB]).effects == (offset,)


def test_a_rest_angle_takes_the_offset_that_stood_for_it(view: Coarse) -> None:
    offset = ChosenEffect("torque_offset", 0)
    model = fitted(view, COULOMB, SPRING, offset)
    merged = with_offsets_merged(model.fit, view.own)
    assert offset not in merged.layout.effects
    again = view.fit(merged.layout, merged.x, iterations=0)
    np.testing.assert_allclose(again.score.deviation, model.score.deviation, rtol=1e-2)
    ended = view.with_rest_angles(model)
    assert view.parts(ended) == {COULOMB, SPRING} and view.with_rest_angles(ended) is ended


# -- what is unknown


def test_an_unknown_law_is_a_curve_on_the_joint_that_errs(view: Coarse) -> None:
    bare = view.begin()
    found = dict(view.unknowns(bare))
    assert gain(bare.score, found[1].score).accepted
    assert {e.joint for e in view.parts(found[1])} == {1} and any(map(is_curve, view.parts(found[1])))
    assert next(iter(found)) == 1  # the one that errs most comes first


# -- near the noise


def test_the_fine_resolution_begins_where_the_coarse_one_ends(near: FineModel, fine: Fine) -> None:
    assert near.fit.x[near.layout.effect_slice(COULOMB)][0] == pytest.approx(HIDDEN, rel=0.01)
    least = fine.criterion.least
    assert np.all(least >= 1.02) and least[1] > least[0]  # friction leaves a trace of what it explains
    assert np.all(near.score.deviation < 1.3) and near.score.total == pytest.approx(
        near.score.by_joint.sum() + near.score.cost
    )
    bare = fine.fit(fine.own, fine.own.vector(near.layout.model(near.fit.x)), 3)
    found = gain(bare.score, near.score)
    assert found.accepted and found.by_joint[1] > 100 and not gain(near.score, bare.score).accepted


def test_a_model_errs_if_more_is_left_above_the_noise_than_counts(
    near: FineModel, fine: Fine, view: Coarse
) -> None:
    noise, least = view.context.noise_floor, view.criterion.least
    assert not fine.errs(near, noise, least)
    bare = fine.fit(fine.own, fine.own.vector(near.layout.model(near.fit.x)), 3)
    assert fine.errs(bare, noise, least)
    above = noise * np.sqrt(np.maximum(bare.score.deviation**2 - fine.criterion.least**2, 0))
    assert not fine.errs(bare, noise, 1.01 * above) and fine.errs(bare, noise, 0.99 * above)
    one = np.array([1e9, 0.99 * above[1]])
    assert fine.errs(bare, noise, one)  # a single joint is enough
