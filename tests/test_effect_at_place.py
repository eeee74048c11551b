"""An effect of the library that only the parameters beside an arbitrary torque show."""

from __future__ import annotations

from dataclasses import replace
from math import cos
from pathlib import Path

import numpy as np
import pytest

from flexviz.diagnosis import forward_search
from flexviz.diagnosis.acceptance import excess
from flexviz.diagnosis.candidates import with_effect
from flexviz.diagnosis.comparison import RefittedCandidate, SearchStep
from flexviz.diagnosis.effect_at_place import effect_at_place
from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.forward_search import ForwardSearch
from flexviz.diagnosis.pipeline import Interrupted
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_place import UnknownPlace, unknown_place
from flexviz.effects import ChosenEffect, JointState
from flexviz.equation import Layout
from flexviz.estimation import ScoredCandidate, UnknownInput
from flexviz.measurements import MeasurementSet, read_set
from flexviz.simulation import ExtraLaw, Pull, make_plan, simulate_plan, write_plan
from tests.planar_arm import HELD_OUT, of_groups

HALF_WIDTH = 0.004


class Uneven(ExtraLaw):
    """A spring that is softer at some angles, on a joint of 1,500 Nm/rad: no effect of the library."""

    def pull(self, at: JointState) -> Pull:
        return Pull(joint=0.4 * 1500.0 * cos(5 * at.theta) * (at.theta - at.q))


def lost_motion(folder: Path) -> MeasurementSet:
    """The planar arm with backlash of several times the joint's deflection."""
    plan = of_groups(make_plan("planar-2r", [f"backlash:joint2:half_width={HALF_WIDTH}"]), HELD_OUT)
    return read_set(write_plan(plan, simulate_plan(plan, 7), folder, 7))


def uneven(folder: Path) -> MeasurementSet:
    plan = of_groups(make_plan("planar-2r"), HELD_OUT)
    plan = replace(plan, laws=((plan.model.joints[1], Uneven()),))
    return read_set(write_plan(plan, simulate_plan(plan, 7), folder, 7))


@pytest.mark.parametrize("makes", [lost_motion, uneven])
def test_an_effect_is_found_from_parameters_that_nothing_biases(makes: object, tmp_path: Path) -> None:
    """From a fit whose stiffness has run away; a law that the effects only resemble stays unknown."""
    measurements = (lost_motion if makes is lost_motion else uneven)(tmp_path / "set")
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    x = context.fit(layout, context.start(layout).x).x
    x[layout.compliance.start + 1] *= 30
    astray = context.fit(layout, x, iterations=0)
    place = unknown_place(context, astray, lambda: None)
    assert place is not None and place.complete and place.joint == "joint2"
    step = effect_at_place(Search(context, lambda text: None), astray, place)
    if makes is uneven:
        assert step is None
        return
    assert step is not None and step.before is astray
    assert step.chosen.effect == ChosenEffect("backlash", 1)
    fit = step.after
    assert fit.x[layout.size] == pytest.approx(HALF_WIDTH, rel=0.05)
    assert excess(fit) < 0.5
    # all candidates of that joint were scored, and no others
    assert step.scores is not None and {s.effect.joint for s in step.scores.ranked} == {1}


def place_of(layout: Layout, left: float) -> UnknownPlace:
    return UnknownPlace(UnknownInput(1, "link", 1.0), layout, np.zeros(layout.size), True, left, True)


@pytest.mark.parametrize(
    ("joints", "excess_now", "left", "found", "looked"),
    [
        (1, 100.0, 0.1, "complete", True),
        (1, 100.0, 0.1, "incomplete", True),  # what is found there leaves more than noise
        (1, 100.0, 0.1, None, True),
        (1, 100.0, 50.0, None, False),  # no place explains all
        (1, 100.0, None, None, False),
        (1, 1.0, 0.1, "complete", False),  # near the noise, candidates are tried as usual
        (2, 100.0, 0.1, "complete", False),  # so they are on a robot with few joints
    ],
)
def test_on_arms_far_from_the_noise_the_place_comes_first(
    demo: MeasurementSet,
    monkeypatch: pytest.MonkeyPatch,
    joints: int,
    excess_now: float,
    left: float | None,
    found: str | None,
    looked: bool,
) -> None:
    layout = Layout(demo.joints)
    context = FitContext(demo, layout)
    base = context.fit(layout, context.start(layout).x, iterations=0)
    search = ForwardSearch(context, base, lambda text: None, lambda fit: None, lambda start: None)
    few = replace(THRESHOLDS, unknown_place=replace(THRESHOLDS.unknown_place, joints=joints))
    monkeypatch.setattr(forward_search, "THRESHOLDS", few)
    monkeypatch.setattr(forward_search, "excess", lambda fit: excess_now)
    place = None if left is None else place_of(layout, left)
    asked = []

    def answer(*_: object) -> UnknownPlace | None:
        asked.append("place")
        return place

    added = with_effect(layout, base.x, ChosenEffect("cable_spring", 1), np.zeros(2))
    scored = ScoredCandidate(ChosenEffect("cable_spring", 1), 1.0, np.zeros(2), np.zeros(1))
    after = replace(base, layout=added.layout, x=added.x)
    step = SearchStep(base, RefittedCandidate(scored, after), {}) if found is not None else None

    def try_there(*_: object) -> SearchStep | None:
        asked.append("effect")
        return step

    monkeypatch.setattr(forward_search, "unknown_place", answer)
    monkeypatch.setattr(forward_search, "effect_at_place", try_there)
    monkeypatch.setattr(search, "add_effects", lambda: asked.append("more"))
    monkeypatch.setattr(
        forward_search, "verdict", lambda *_: "unknown" if found == "incomplete" else "missing"
    )
    monkeypatch.setattr(forward_search, "changing_size", lambda *_: None)
    assert search.look_at_place_first() == looked
    expected = [] if joints == 2 or excess_now == 1.0 else ["place"]
    if looked:
        expected += ["effect", "more"] if found else ["effect"]
    assert asked == expected
    assert search.steps == ([step] if looked and found == "complete" else [])
    if looked and found != "complete":  # neither is done again
        search.find_place()
        assert asked == expected and search.place is place


def test_an_effect_that_is_only_being_tried_is_taken_back_if_the_user_stops(
    demo: MeasurementSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = Layout(demo.joints)
    context = FitContext(demo, layout)
    base = context.fit(layout, context.start(layout).x, iterations=0)
    search = ForwardSearch(context, base, lambda text: None, lambda fit: None, lambda start: None)
    scored = ScoredCandidate(ChosenEffect("cable_spring", 1), 1.0, np.zeros(2), np.zeros(1))
    step = SearchStep(base, RefittedCandidate(scored, base), {})
    monkeypatch.setattr(forward_search, "effect_at_place", lambda *_: step)

    def stopped() -> None:
        assert search.steps == [step]
        raise Interrupted

    monkeypatch.setattr(search, "add_effects", stopped)
    with pytest.raises(Interrupted):
        search.try_effects_at(place_of(layout, 0.1))
    assert search.steps == []
