"""What both resolutions offer the search: candidates, what cannot be dropped, pruned models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flexviz.diagnosis.motion_fit import MotionContext

from flexviz.diagnosis.coarse import Coarse, CoarseModel
from flexviz.diagnosis.fine import Fine
from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.resolution import without
from flexviz.diagnosis.search import Search, best_of_each_place
from flexviz.diagnosis.unknown_curve import is_curve
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.measurements import MeasurementSet

COULOMB, OFFSET = ChosenEffect("coulomb_friction", 1), ChosenEffect("torque_offset", 0)
STRIBECK, GAIN = ChosenEffect("stribeck_friction", 1), ChosenEffect("torque_gain", 1)
SPRING, DELAY = ChosenEffect("cable_spring", 0), ChosenEffect("torque_delay")
CURVE = ChosenEffect("free_curve_friction", 1)
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


@pytest.fixture(scope="module")
def view(demo: MeasurementSet) -> Coarse:
    """Of the demonstration, which hides Coulomb friction of 3 Nm on joint 2."""
    return coarse_of(demo)


@pytest.fixture(scope="module")
def fine(demo: MeasurementSet) -> Fine:
    own = Layout(demo.joints)
    return Fine(FitContext(demo, own), own, lambda _: None)


def test_what_could_not_be_real_is_impossible(view: Coarse) -> None:
    for gain, impossible in ((-0.6, True), (-0.1, False)):
        model = with_values(view, torque_gain=[gain])
        assert view.impossible(model.fit) == ([GAIN] if impossible else [])
    fast = 2 * float(np.abs(view.context.signals.theta[1]).max())
    for velocity, impossible in ((fast, True), (0.05, False)):
        model = with_values(view, stribeck_friction=[0.5, velocity])
        assert view.impossible(model.fit) == ([STRIBECK] if impossible else [])


def test_an_impossible_effect_goes_although_it_describes_the_data(view: Coarse) -> None:
    """Friction that falls up to the top speed is Coulomb and viscous friction."""
    layout = Layout(view.own.joints, (COULOMB, STRIBECK))
    x = layout.vector(fitted(view).layout.model(fitted(view).fit.x))
    fast = 2 * float(np.abs(view.context.signals.theta[1]).max())
    x[layout.effect_slice(COULOMB)], x[layout.effect_slice(STRIBECK)] = 1.0, (2.0, fast)
    pruned = view.pruned(view.fit(layout, x, iterations=0))
    assert view.parts(pruned) == {COULOMB}
    assert pruned.fit.x[pruned.layout.effect_slice(COULOMB)][0] == pytest.approx(HIDDEN, rel=0.01)


def test_the_sets_own_effects_stay_and_those_beside_which_others_are_defined(demo: MeasurementSet) -> None:
    view = coarse_of(demo, Layout(demo.joints, (OFFSET,)))
    layout = Layout(demo.joints, (OFFSET, COULOMB, GAIN, SPRING))
    assert view.firm(layout) == {OFFSET}
    assert view.firm(Layout(demo.joints, (*layout.effects, STRIBECK))) == {OFFSET, COULOMB}
    offset = ChosenEffect("torque_offset", 1)
    springs = Layout(demo.joints, (offset, ChosenEffect("cable_spring", 1), CURVE))
    assert view.firm(springs) == {OFFSET, offset, CURVE}  # the offset stands for the spring's rest angle
    assert view.pruned(fitted(view, OFFSET, COULOMB)).layout.effects == (OFFSET, COULOMB)


def test_a_model_is_pruned_to_what_the_data_need(view: Coarse, fine: Fine) -> None:
    more = (OFFSET, COULOMB, ChosenEffect("quadratic_friction", 0), SPRING)
    model = fitted(view, *more)
    pruned = view.pruned(model)
    assert view.parts(pruned) == {COULOMB} and view.pruned(pruned) is pruned
    assert pruned.fit.x[pruned.layout.effect_slice(COULOMB)][0] == pytest.approx(HIDDEN, rel=0.01)
    assert not view.significant(pruned).any()
    layout = Layout(view.own.joints, more[:3])
    near = fine.pruned(fine.fit(layout, layout.vector(model.layout.model(model.fit.x))))
    assert fine.parts(near) == {COULOMB} and fine.complete(near)
    assert near.fit.x[near.layout.effect_slice(COULOMB)][0] == pytest.approx(HIDDEN, rel=0.01)


def test_the_rich_model_has_what_the_data_need(view: Coarse) -> None:
    rich = view.rich()
    assert COULOMB in view.parts(rich) and len(view.parts(rich)) > 4
    assert view.parts(view.pruned(rich)) == {COULOMB}


def test_candidates_promise_what_they_gain(view: Coarse) -> None:
    bare = view.bare()
    assert not view.at_noise(bare) and view.significant(bare)[1]
    found = view.candidates(bare)
    best = best_of_each_place(found)[0]
    assert best.key == COULOMB and best.place == 1
    larger = view.with_added(bare, [best])
    assert view.promising(bare, larger) and not view.promising(larger, bare)
    gain = view.gain(bare, larger, len(found))
    assert gain.accepted and gain.delta > view.least()
    assert view.above(larger) < 0.05 * view.above(bare)
    assert view.parts(Search(view).run(larger)) == {COULOMB}  # nothing gains what it costs
    # a candidate does not become another one by the choice among more
    assert view.gain(bare, larger, 2 * len(found)).delta == pytest.approx(gain.delta - np.log(2))


def test_what_happens_once_may_have_happened_any_time(view: Coarse) -> None:
    group = view.measurements.fit_groups[0].name
    contact = ChosenEffect("external_contact", 1, group)
    base = fitted(view, COULOMB)
    layout = Layout(view.own.joints, (COULOMB, contact))
    x = layout.vector(base.layout.model(base.fit.x))
    x[layout.effect_slice(contact)] = 0.0, 2.0, 3.0
    model = view.fit(layout, x, iterations=0)
    plain, many = view.gain(base, model, 1), view.gain(base, model, 100)
    assert plain.delta < -np.log(5000 / 0.05) and many.delta == pytest.approx(plain.delta - np.log(100))


def test_a_law_is_exchanged_where_it_is_a_rival(view: Coarse) -> None:
    """And not for one that describes the data no better."""
    model = fitted(view, COULOMB)
    for swap in view.swaps(model):
        assert view.parts(swap(model)) == {COULOMB}
    link = ChosenEffect("link_coulomb_friction", 1)
    other = view.with_added(view.bare(), [c for c in view.candidates(view.bare()) if c.key == link])
    assert view.parts(other) == {link}


def test_a_drive_gain_is_not_judged_by_torques_that_it_makes_small(demo: MeasurementSet) -> None:
    """A wrong gain of −.5 halves all errors of a joint; its torque's own measure does not change."""
    halved = tuple(
        replace(
            group,
            segments=tuple(replace(s, tau=s.tau * np.array([1.0, 3.0])) for s in group.segments),
        )
        for group in demo.groups
    )
    view = coarse_of(replace(demo, groups=halved))
    bare, scaled = view.bare(), fitted(view, GAIN)
    plain = scaled.likelihood.losses.sum() - bare.likelihood.losses.sum()
    judged = view.gain(bare, scaled, 1)
    assert plain < 0 and judged.delta < float(judged.by_joint.sum())
    assert scaled.likelihood.other > bare.likelihood.other


def test_an_unknown_input_is_a_curve_on_the_joint_that_errs(view: Coarse) -> None:
    bare = view.bare()
    (beside,) = view.unknowns(bare)
    model = beside(bare)
    assert view.gain(bare, model, 1).accepted
    assert {e.joint for e in view.parts(model)} == {1} and any(map(is_curve, view.parts(model)))
    assert not list(view.unknowns(fitted(view, COULOMB)))  # nothing unknown is left


def test_a_smaller_model_has_the_other_effects(view: Coarse) -> None:
    layout = Layout(view.own.joints, (COULOMB, OFFSET))
    assert without(layout, [COULOMB]).effects == (OFFSET,)
