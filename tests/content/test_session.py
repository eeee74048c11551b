"""One analysis and its history."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flexviz.analysis.diagnosis import Diagnosis, Step
from flexviz.analysis.identification import FitSettings
from flexviz.base.errors import InputError
from flexviz.content.records import ParameterEstimate, Verdict
from flexviz.content.session import (
    HISTORY,
    Analysis,
    ResultStanding,
    Session,
    effect_added,
    first_fit,
    fit_before,
    runs,
    standing,
    with_roles,
)
from flexviz.data.measurements import MeasurementSet, read_set
from tests.small_set import write_small_set


@pytest.fixture(scope="module")
def measurements(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return read_set(write_small_set(tmp_path_factory.mktemp("session") / "small"))


def test_starts_with_the_sets_own_split(measurements: MeasurementSet) -> None:
    analysis = Session.of(measurements).analysis
    assert analysis.groups_with("fit") == ("g1", "g2")
    assert analysis.groups_with("validate") == ("g3",)
    assert analysis.identification is None and not analysis.up_to_date


def test_undo_and_redo(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    first = session.analysis
    session = session.then("without g2", first.with_role("g2", "ignore"))
    session = session.then("offset", session.analysis.with_effects(["torque_offset"]))
    assert session.analysis.effects == ("torque_offset",)
    session = session.undo()
    assert session.analysis.effects == () and session.analysis.groups_with("ignore") == ("g2",)
    session = session.undo()
    assert session.analysis.same_as(first)
    assert session.undo() is session
    session = session.redo().redo()
    assert session.analysis.effects == ("torque_offset",)
    assert session.redo() is session


def test_a_new_change_forgets_what_was_undone(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    session = session.then("refine", session.analysis.with_fit(refine=False)).undo()
    session = session.then("eso", session.analysis.with_fit(observer="eso"))
    assert session.redo() is session and session.analysis.fit.refine


def test_a_slider_is_one_step_and_no_change_is_none(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    for bandwidth in (20.0, 30.0, 40.0):
        session = session.then("bandwidth", session.analysis.with_fit(bandwidth=bandwidth))
    assert len(session.past) == 1 and session.undo().analysis.fit.bandwidth is None
    assert session.then("nothing", replace(session.analysis)) is session


def test_the_history_has_an_end(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    for i in range(HISTORY + 20):
        session = session.then(f"change {i}", session.analysis.with_fit(bandwidth=10.0 + i))
    assert len(session.past) == HISTORY


def test_a_result_belongs_to_its_settings(measurements: MeasurementSet) -> None:
    result: Any = object()
    analysis = Session.of(measurements).analysis
    fitted = analysis.with_identification(result, analysis.settings)
    assert fitted.up_to_date
    assert not fitted.with_effects(["torque_offset"]).up_to_date
    assert not fitted.same_as(analysis)


def test_roles_decide_what_is_fitted(measurements: MeasurementSet) -> None:
    chosen = with_roles(measurements, {"g1": "fit", "g2": "ignore", "g3": "fit"})
    assert [g.name for g in chosen.groups] == ["g1", "g3"]
    assert [g.name for g in chosen.fit_groups] == ["g1", "g3"]
    assert chosen.path == Path(measurements.path)


def test_unknown_group_or_role(measurements: MeasurementSet) -> None:
    analysis = Session.of(measurements).analysis
    with pytest.raises(InputError, match="g1, g2, g3"):
        analysis.with_role("g9", "fit")
    with pytest.raises(InputError, match="role"):
        analysis.with_role("g1", "train")  # type: ignore[arg-type]


# -- diagnosis -------------------------------------------------------------------------------------------


def diagnosis(verdict: Verdict = "missing", error: float = 1.0) -> Diagnosis:
    step = Step(None, (error, error), (error, error), verdict=verdict)
    return Diagnosis(
        set_name="set", verdict=verdict, findings=(), steps=(step,), effects=(), parameters=(), seconds=0.1
    )


@pytest.mark.parametrize(
    "other",
    [
        {"fit": FitSettings(observer="eso")},
        {"fit": FitSettings(bandwidth=80.0)},
        {"fit": FitSettings(refine=False)},
        {"fit": FitSettings(effects=("coulomb_friction:joint1",))},
        {"roles": ()},
    ],
)
def test_a_verdict_belongs_to_one_model_observer_and_data(measurements: MeasurementSet, other: Any) -> None:
    found = Analysis.start(measurements).with_diagnosis(diagnosis())
    assert found.current_diagnosis is found.diagnosis
    changed = replace(found, **other)
    assert changed.current_diagnosis is None and changed.diagnosis is found.diagnosis
    assert replace(changed, **{name: getattr(found, name) for name in other}).diagnosis_up_to_date
    ordered = found.with_fit(effects=["a", "b"]).with_diagnosis(diagnosis())
    assert ordered.with_fit(effects=["b", "a"]).diagnosis_up_to_date  # their order is no matter


def fit(at_bound: bool = False) -> Any:
    """As much of an identification as its standing depends on."""
    stiffness = ParameterEstimate("stiffness", "joint1", 1.0, 0.1, "Nm/rad", "yes", 1.0, at_bound=at_bound)
    return SimpleNamespace(parameters=(stiffness,), iterations=(1,))


def test_all_texts_follow_from_what_the_results_belong_to(measurements: MeasurementSet) -> None:
    start = Analysis.start(measurements)
    assert standing(start) == ResultStanding("none", "none", "")
    fitted = start.with_identification(fit(), start.settings)
    assert standing(fitted) == ResultStanding("present", "none", "fit")
    judged = fitted.with_diagnosis(diagnosis())
    assert standing(judged) == ResultStanding("present", "present", "verdict")
    # another observer: both are of an earlier model until the next Run; then the verdict still is
    other = judged.with_fit(observer="eso", bandwidth=80.0)
    assert standing(other) == ResultStanding("earlier", "earlier", "fit")
    again = other.with_identification(fit(at_bound=True), other.settings)
    now = standing(again)
    assert (now.fit, now.verdict, now.errors) == ("present", "earlier", "fit")
    assert "At the bound of what is possible: stiffness of joint1" in now.bounds
    # a diagnosis of it does not make its error that of the diagnosis
    assert standing(again.with_diagnosis(diagnosis("nothing-missing"))).errors == "fit"
    # a tick taken away and put back is the same model
    two = start.with_effects(["a", "b"]).with_diagnosis(diagnosis())
    back = two.without_effects(["a"])
    assert standing(back).verdict == "earlier"
    assert standing(back.with_effects(["a"])).verdict == "present"


def test_every_run_is_in_the_history(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    assert runs(session) == [] and first_fit(session) is None and fit_before(session) is None
    one = session.analysis.with_identification(fit(), session.analysis.settings)
    session = session.then("identified", one)
    assert runs(session) == [one]
    judged = one.with_diagnosis(diagnosis())
    session = session.then("looked", judged)
    assert runs(session) == []  # it is a model of the staircase
    other = judged.with_fit(observer="eso", bandwidth=80.0)
    tuned = other.with_identification(fit(), other.settings)
    session = session.then("bandwidth", other).then("identified", tuned)
    assert runs(session) == [tuned]
    assert first_fit(session) is fit_before(session) is one.identification
    assert runs(session.undo()) == [tuned] and fit_before(session.undo()) is None


def test_an_added_effect_is_told_once(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    session = session.then(
        "identified", session.analysis.with_identification(fit(), session.analysis.settings)
    )
    assert not effect_added(session)  # there is no model before
    one = session.analysis
    ticked = session.then("effects", one.with_effects(["coulomb_friction:joint1"]))
    assert not effect_added(ticked)  # not fitted yet
    more = ticked.analysis.with_identification(fit(), ticked.analysis.settings)
    added = ticked.then("added Coulomb friction", more)
    assert effect_added(added)
    again = added.then("identified", more.with_identification(fit(), more.settings))
    assert not effect_added(again)  # the same model
    shown = added.then("model 0 shown", one)
    assert not effect_added(shown) and not effect_added(shown.then("model 1 shown", more))
    other = more.without_effects(more.effects)
    assert not effect_added(added.then("removed", other.with_identification(fit(), other.settings)))


def test_undo_brings_back_diagnosis_and_result_without_computing(measurements: MeasurementSet) -> None:
    session = Session.of(measurements)
    first, second = diagnosis(), diagnosis("nothing-missing", 0.1)
    result: Any = object()
    session = session.then("looked", session.analysis.with_diagnosis(first))
    added = session.analysis.with_effects(["torque_offset:joint1"])
    assert not added.diagnosis_up_to_date and added.diagnosis is first
    added = added.with_identification(result, added.settings).with_diagnosis(second)
    session = session.then("added", added)
    assert session.undoes == "added" and session.redoes == ""
    assert session.analysis.diagnosis is second and session.analysis.diagnosis_up_to_date
    session = session.undo()
    assert session.analysis.diagnosis is first and session.analysis.identification is None
    assert (session.undoes, session.redoes) == ("looked", "added")
    session = session.redo()
    assert session.analysis.diagnosis is second and session.analysis.identification is result
    assert Session.of(measurements).undoes == ""


def test_stairs_lead_to_the_present_model(measurements: MeasurementSet) -> None:
    analysis = Session.of(measurements).analysis
    for names in (("a",), ("a", "b"), ("a", "b", "c")):
        analysis = analysis.with_fit(effects=names).with_diagnosis(diagnosis())
    assert [len(stair.effects) for stair in analysis.model_steps] == [1, 2, 3]
    removed = analysis.with_fit(effects=("a", "c")).with_diagnosis(diagnosis())
    assert [stair.effects for stair in removed.model_steps] == [("a",), ("a", "c")]
    again = removed.with_diagnosis(diagnosis())
    assert [stair.effects for stair in again.model_steps] == [("a",), ("a", "c")]
    other = again.with_role("g2", "ignore").with_diagnosis(diagnosis())
    assert [stair.effects for stair in other.model_steps] == [("a", "c")]
    assert other.without_result().model_steps == () and other.without_result().diagnosis is None
