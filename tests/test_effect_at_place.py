"""An effect of the library that only the parameters beside an arbitrary torque show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flexviz.diagnosis.comparison import SearchStep
from flexviz.diagnosis.effect_at_place import effects_at_place
from flexviz.diagnosis.pipeline import Interrupted
from flexviz.diagnosis.unknown_place import UnknownPlace, unknown_place

from flexviz.diagnosis import effect_at_place, forward_search
from flexviz.diagnosis.acceptance import Gained, excess
from flexviz.diagnosis.candidates import ModelStart
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.search import Search
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import Side, UnknownInput
from flexviz.measurements import MeasurementSet
from tests.planar_arm import HELD_OUT, planar_set
from tests.unknown_laws import Uneven, place_at, search_of, set_with, step_from

HALF_WIDTH = 0.004
PARAMETER = {"stiffness_hardening": "cubic_stiffness", "load_dependent_friction": "coefficient"}


def found_at_place(measurements: MeasurementSet) -> list[SearchStep]:
    """The effects found on joint 2, from a fit whose stiffness has run away."""
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    x = context.fit(layout, context.start(layout).x).x
    x[layout.compliance.start + 1] *= 30
    astray = context.fit(layout, x, iterations=0)
    place = unknown_place(context, astray, lambda: None)
    assert place is not None and place.joint == "joint2"
    steps = effects_at_place(Search(context, lambda text: None), astray, place)
    assert not steps or steps[0].before is astray
    return steps


def test_backlash_is_found_from_parameters_that_nothing_biases(tmp_path: Path) -> None:
    """Of several times the joint's deflection."""
    hidden = (f"backlash:joint2:half_width={HALF_WIDTH}",)
    (step,) = found_at_place(planar_set(tmp_path / "set", hidden, 7, groups=HELD_OUT))
    assert step.chosen.effect == ChosenEffect("backlash", 1)
    fit = step.after
    assert fit.x[step.before.layout.size] == pytest.approx(HALF_WIDTH, rel=0.05)
    assert excess(fit) < 0.5
    # all candidates that act on that joint were scored, and no others
    assert step.scores is not None and {s.effect.joint for s in step.scores.ranked} == {1, None}


def test_a_contact_is_found_there(tmp_path: Path) -> None:
    """In one group, for a while."""
    hidden = ("external_contact:joint2:group=t1p1:torque=8:start=2.2:end=3.1",)
    (step,) = found_at_place(planar_set(tmp_path / "set", hidden, 7, groups=HELD_OUT))
    assert step.chosen.effect == ChosenEffect("external_contact", 1, "t1p1")
    assert step.after.x[-3:] == pytest.approx([8.0, 2.2, 3.1], rel=0.002)
    assert excess(step.after) < 0.5


def test_an_effect_of_the_whole_robot_may_seem_to_act_at_one_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside an arbitrary torque in the transmission of joint 1, wrong masses leave hardly anything.

    They score best and explain everything: none but their rivals are tried.
    """
    hidden = ("payload_error:p2:relative_mass_error=0.04",)
    measurements = planar_set(tmp_path / "set", hidden, 7, groups=HELD_OUT)
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    base = context.fit(layout, context.start(layout).x)
    right = Layout(layout.joints, (ChosenEffect("payload_error", None, payload="p2"),))
    beside = context.fit(right, right.vector(layout.model(base.x))).x[: layout.size]
    place = UnknownPlace(UnknownInput(0, "transmission", 1.0), layout, beside, True, 0.5, True)
    assert place.entry(excess(base)) == "deflection"
    monkeypatch.setattr(effect_at_place, "best_refits", lambda *_: pytest.fail("others are refitted"))
    (step,) = effects_at_place(Search(context, lambda text: None), base, place)
    assert step.chosen.effect == right.effects[0] and excess(step.after) < 0.5
    assert step.after.x[-1] == pytest.approx(0.04, rel=0.02)


def test_what_only_resembles_an_effect_is_not_found(tmp_path: Path) -> None:
    measurements, _ = set_with(lambda _: Uneven(1500.0, 0.4), 1, tmp_path / "set", 7)
    assert found_at_place(measurements) == []


def test_only_refits_that_leave_little_more_than_the_best_are_continued(
    demo: MeasurementSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    forward = search_of(demo)
    base, search, continued = forward.base, forward.search, []
    left = {"best": 2.0, "close": 7.9, "far": 8.1}
    refits = [SimpleNamespace(fit=name) for name in left]

    def halving(refitted: list[Any]) -> list[Any]:
        continued.append([r.fit for r in refitted])
        return []

    monkeypatch.setattr(effect_at_place, "excess", lambda fit: left[fit] if isinstance(fit, str) else 100.0)
    monkeypatch.setattr(effect_at_place, "best_refits", lambda *_: refits)
    monkeypatch.setattr(search, "explains_everything", lambda *_: False)
    monkeypatch.setattr(search, "afresh", lambda *_: base)
    monkeypatch.setattr(search, "halving", halving)
    assert effects_at_place(search, base, replace(place_at(1, base.layout), x=base.x)) == []
    assert continued == [["best", "close"]]


@pytest.mark.parametrize(("left", "fits"), [(0.5, 0), (5.0, 1)])
def test_refits_begin_afresh_where_something_else_may_bias_the_parameters(
    left: float, fits: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not beside a torque that explains all that is missing, even if the side is not known."""
    measurements, _ = set_with(lambda _: Uneven(1500.0, 0.4), 1, tmp_path / "set", 7)
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    base = context.fit(layout, context.start(layout).x, iterations=0)
    place = UnknownPlace(UnknownInput(1, "motor", 1.0), layout, base.x, False, left, True)
    search, afresh = Search(context, lambda text: None), []

    def counted(start: ModelStart, iterations: int) -> Fit:
        afresh.append(start.layout.effects)
        return base

    monkeypatch.setattr(search, "afresh", counted)
    monkeypatch.setattr(search, "acceptable", lambda *_: None)
    monkeypatch.setattr(effect_at_place, "best_refits", lambda *_: [])
    assert effects_at_place(search, base, place) == [] and len(afresh) == fits


def test_an_effect_is_measured_by_what_the_present_model_leaves_if_that_is_less(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parameters beside a torque at the place may leave far more, for the fit absorbs what is missing."""
    measurements, _ = set_with(lambda _: Uneven(1500.0, 0.4), 1, tmp_path / "set", 7)
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    base = context.fit(layout, context.start(layout).x)
    x = base.x.copy()
    x[layout.compliance.start + 1] *= 5
    start = context.fit(layout, x, iterations=0)
    assert excess(start) > 2 * excess(base)
    asked = []

    def none(search: Search, fit: Fit, place: UnknownPlace, gained: Gained, most: float) -> None:
        asked.append(most)

    monkeypatch.setattr(effect_at_place, "_added", none)
    place = UnknownPlace(UnknownInput(1, "transmission", 1.0), layout, x, True, 0.5, True)
    assert effects_at_place(Search(context, lambda text: None), base, place) == []
    assert asked[0] == pytest.approx(min(excess(base), excess(start) / 2), rel=1e-6)


def test_two_effects_at_one_place_are_found_together(tmp_path: Path) -> None:
    hidden = {"stiffness_hardening": 3e6, "load_dependent_friction": 0.01}
    texts = [f"{name}:joint2:{PARAMETER[name]}={size}" for name, size in hidden.items()]
    first, second = found_at_place(planar_set(tmp_path / "set", texts, 7, groups=HELD_OUT))
    assert second.before is first.after and excess(second.after) < 0.5 < excess(first.after)
    layout = second.after.layout
    found = {e.effect: second.after.x[where][0] for e, where in layout.effect_slices()}
    assert found == {name: pytest.approx(size, rel=0.05) for name, size in hidden.items()}


@pytest.mark.parametrize(
    ("side", "acts"), [("motor", "torque_gain"), ("transmission", "backlash"), ("link", "external_contact")]
)
def test_effects_are_tried_on_the_side_that_explains_nearly_all(side: Side, acts: str) -> None:
    layout = Layout(("joint1",))
    place = UnknownPlace(UnknownInput(0, side, 1.0), layout, np.zeros(layout.size), True, 0.5, True)
    assert place.entry(100.0) == EFFECTS[acts].entry
    assert place.entry(20.0) is None  # something else may act on another side
    assert replace(place, sure=False).entry(100.0) is None


@pytest.mark.parametrize(
    ("excess_now", "explains_all", "found", "looked"),
    [
        (100.0, True, "complete", True),
        (100.0, True, "incomplete", True),  # what is found there leaves more than noise
        (100.0, True, "drifting", True),  # it does, but its size grows
        (100.0, True, None, True),
        (100.0, False, None, False),  # no place explains all
        (100.0, None, None, False),
        (1.0, True, "complete", False),  # near the noise, candidates are tried as usual
    ],
)
def test_far_from_the_noise_the_place_comes_first(
    demo: MeasurementSet,
    monkeypatch: pytest.MonkeyPatch,
    excess_now: float,
    explains_all: bool | None,
    found: str | None,
    looked: bool,
) -> None:
    search = search_of(demo)
    base = search.base
    monkeypatch.setattr(forward_search, "excess", lambda fit: excess_now)
    place = None if explains_all is None else place_at(1, base.layout, explains_all)
    asked = []

    def answer(*_: object) -> UnknownPlace | None:
        asked.append("place")
        return place

    step = step_from(base, ChosenEffect("cable_spring", 1)) if found is not None else None

    def try_there(*_: object) -> list[SearchStep]:
        asked.append("effect")
        return [step] if step else []

    monkeypatch.setattr(forward_search, "unknown_place", answer)
    monkeypatch.setattr(forward_search, "effects_at_place", try_there)
    monkeypatch.setattr(search, "add_effects", lambda: asked.append("more"))
    monkeypatch.setattr(forward_search, "verdict", lambda *_: "missing" if found == "complete" else "unknown")
    monkeypatch.setattr(forward_search, "changing_size", lambda *_: None)
    monkeypatch.setattr(forward_search, "explained_by_drift", lambda *_: found == "drifting")
    assert search.look_at_place_first() == looked
    kept = found in ("complete", "drifting")
    expected = [] if excess_now == 1.0 else ["place"]
    if looked:
        expected += ["effect", "more"] if found in ("complete", "incomplete") else ["effect"]
    assert asked == expected
    assert search.steps == ([step] if looked and kept else [])
    if looked and not kept:  # neither is done again
        search.find_place()
        assert asked == expected and search.place is place


def test_an_effect_that_is_only_being_tried_is_taken_back_if_the_user_stops(
    demo: MeasurementSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = search_of(demo)
    step = step_from(search.base, ChosenEffect("cable_spring", 1))
    monkeypatch.setattr(forward_search, "effects_at_place", lambda *_: [step])

    def stopped() -> None:
        assert search.steps == [step]
        raise Interrupted

    monkeypatch.setattr(forward_search, "explained_by_drift", lambda *_: False)
    monkeypatch.setattr(search, "add_effects", stopped)
    with pytest.raises(Interrupted):
        search.try_effects_at(place_at(1, search.base.layout))
    assert search.steps == []


@pytest.mark.parametrize(
    ("left", "apply", "kept"),
    [(2.0, True, True), (2.0, False, False), (3.0, True, False)],  # an arbitrary torque there leaves 5
)
def test_effects_that_leave_less_than_any_torque_at_the_place_are_kept(
    demo: MeasurementSet, monkeypatch: pytest.MonkeyPatch, left: float, apply: bool, kept: bool
) -> None:
    search = search_of(demo, apply)
    step = step_from(search.base, ChosenEffect("cable_spring", 1))
    monkeypatch.setattr(forward_search, "effects_at_place", lambda *_: [step])
    monkeypatch.setattr(search, "add_effects", lambda: None)
    monkeypatch.setattr(forward_search, "verdict", lambda *_: "unknown")
    monkeypatch.setattr(forward_search, "excess", lambda fit: left)
    monkeypatch.setattr(forward_search, "explained_by_drift", lambda *_: False)
    search.place = place = place_at(1, search.base.layout, complete=False)
    search.try_effects_at(place)
    assert search.steps == ([step] if kept else [])
    assert search.place is (None if kept else place)


def test_two_effects_are_not_the_answer_where_one_is_asked_for(
    demo: MeasurementSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = search_of(demo)
    search.apply = False
    steps = [step_from(search.base, ChosenEffect(name, 1)) for name in ("cable_spring", "backlash")]
    monkeypatch.setattr(forward_search, "effects_at_place", lambda *_: steps)
    search.try_effects_at(place_at(1, search.base.layout))
    assert search.steps == []
