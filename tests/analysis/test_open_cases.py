"""What the diagnosis does not get right yet, or only just does.

Each open case takes a minute or two: `pytest -m study tests/analysis/test_open_cases.py` runs them. A case
that passes there moves to the tests of its subject.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.diagnosis_study.cases import selected
from benchmarks.diagnosis_study.making import case_folder, make
from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.analysis.diagnosis.coarse import Coarse
from flexviz.analysis.diagnosis.criterion import gain
from flexviz.analysis.diagnosis.elimination import needs
from flexviz.analysis.diagnosis.search import Search
from flexviz.analysis.identification import identify
from flexviz.analysis.motion import MotionContext
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout, layout_of
from tests.analysis.test_elimination_arm import HIDDEN, arm_with
from tests.analysis.test_varying_size import with_growing_friction
from tests.cases import slow
from tests.model.test_startup_friction import HIDDEN as STARTUP
from tests.model.test_startup_friction import simulated
from tests.planar_arm import HELD_OUT, planar_set
from tests.unknown_laws import Rough, set_with

BY_LOAD = "load_dependent_friction:joint2"
OPEN = pytest.mark.xfail(strict=True, reason="not right yet"), pytest.mark.study


def not_yet(case: Any) -> Any:
    """An open case: it runs with the studies, and fails once it is right."""
    for mark in OPEN:
        case = mark(case)
    return case


def studied(folder: Path, seed: int, name: str) -> Diagnosis:
    """The diagnosis of a case of the study."""
    (case,) = selected(seed, name)
    make(folder, case)
    return diagnose(read_set(case_folder(folder, case.name)), apply=True)


def added(result: Diagnosis) -> list[str]:
    """The effects of the steps, without free curves."""
    return [s.added.text for s in result.steps if s.added is not None and not s.added.stopgap]


# -- drops


def test_a_curve_goes_where_an_effect_has_taken_its_place(demo: MeasurementSet) -> None:
    own = Layout(demo.joints)
    view = Coarse(MotionContext(demo, own.joints, stand_ins=True), own, lambda _: None)
    friction, curve = ChosenEffect("coulomb_friction", 1), ChosenEffect("free_curve_friction", 1)
    layout = Layout(demo.joints, (friction, curve))
    pruned = Search(view).pruned(view.fit(layout, view.context.start(layout).x))
    assert view.parts(pruned) == {friction}


# -- one J for fits and search


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> Coarse:
    """Friction of both joints, and three effects that leave about twice the tolerance."""
    measurements = arm_with(tmp_path_factory.mktemp("several") / "set", 3.0)
    own = layout_of(measurements)
    return Coarse(MotionContext(measurements, own.joints, stand_ins=True), own, lambda _: None)


def test_the_search_ends_no_higher_than_what_is_left_of_the_truth(several: Coarse) -> None:
    search, layout = Search(several), Layout(several.own.joints, tuple(HIDDEN))
    truth = several.fit(layout, several.context.start(layout).x)
    assert search.run(several.begin()).score.total <= search.pruned(truth).score.total + 1


def test_a_fit_ends_no_higher_than_where_it_begins(several: Coarse) -> None:
    """Both have one floor. J counts held-out groups, too, of which a fit knows nothing."""
    layout = Layout(several.own.joints, tuple(HIDDEN))
    truth = several.fit(layout, several.context.start(layout).x)
    for _, (_, x) in needs(several.linearised(truth), truth.score, several).items():
        smaller = Layout(several.own.joints, tuple(e for e in HIDDEN if x[layout.effect_slice(e)].any()))
        start = several.towards(truth, x, smaller)
        before, after = (several.fit(smaller, start, iterations=k) for k in (0, 20))
        lost = -gain(before.score, after.score).held_out
        assert after.fit.objective <= before.fit.objective
        assert after.score.total <= before.score.total + 1 + max(lost, 0.0)


# -- stopping, errors, trace


def test_a_stop_without_apply_gives_a_result(demo: MeasurementSet) -> None:
    assert diagnose(demo, should_stop=lambda: True).stopped


@not_yet
def test_the_present_model_has_one_error(demo: MeasurementSet) -> None:
    """Of the identification and of the first step: the app shows both."""
    from flexviz.analysis.diagnosis import prediction_errors

    errors = prediction_errors(demo, identify(demo).model)
    assert diagnose(demo).steps[0].rms_validation == pytest.approx(errors.rms_validation, rel=0.01)


@pytest.fixture(scope="module")
def walked(demo: MeasurementSet) -> Diagnosis:
    return diagnose(with_growing_friction(demo, 0.4, along_load=True), apply=True)


@pytest.mark.slow
def test_accepted_moves_lead_to_the_model(walked: Diagnosis) -> None:
    """From the trace alone the model can be rebuilt, with its free curve."""
    have = set[str]()
    for move in walked.trace:
        if move.accepted:
            assert set(move.removed) <= have and not have & set(move.added)
            have = (have - set(move.removed)) | set(move.added)
    assert have == {step.added.text for step in walked.steps if step.added is not None}


@pytest.mark.slow
def test_every_accepted_move_changes_the_model(walked: Diagnosis) -> None:
    """None fits the same model again or exchanges two laws to and fro."""
    moves = [(move.added, move.removed) for move in walked.trace if move.accepted]
    assert all(added or removed for added, removed in moves)
    assert len(set(moves)) == len(moves)


# -- what is found


@not_yet
def test_a_growing_friction_is_said_to_grow(demo: MeasurementSet) -> None:
    result = diagnose(with_growing_friction(demo, 0.4), apply=True)
    assert [note.kind for note in result.notes][:1] == ["changing"]


@pytest.mark.slow
def test_a_law_that_a_curve_describes_alone_has_no_effect_beside_it(tmp_path: Path) -> None:
    """Friction in a part of the range is no Coulomb friction of its mean, stated at 93 %."""
    result = diagnose(set_with(lambda _: Rough(), 1, tmp_path / "set")[0], apply=True)
    assert all(f.confidence < 0.7 for f in result.findings)


@pytest.mark.parametrize(
    ("hidden", "seed"),
    [
        pytest.param(
            {"cable_spring:joint2": "stiffness=9,rest_angle=0.6", BY_LOAD: "coefficient=0.1"}, 5, marks=OPEN
        ),
        ({"stiffness_hardening:joint2": "cubic_stiffness=3e6", BY_LOAD: "coefficient=0.01"}, 7),
        slow({"backlash:joint2": "half_width=0.004"}, 7),
    ],
    ids=["spring", "hardening", "backlash"],
)
def test_what_is_hidden_on_one_joint_is_found(hidden: dict[str, str], seed: int, tmp_path: Path) -> None:
    texts = [f"{place}:{values}" for place, values in hidden.items()]
    result = diagnose(planar_set(tmp_path / "set", texts, seed, groups=HELD_OUT), apply=True)
    assert set(added(result)) == set(hidden) and result.steps[-1].verdict == "nothing-missing"


@not_yet
def test_imitations_of_a_law_of_no_library_are_not_stated_surely(tmp_path: Path) -> None:
    result = studied(tmp_path, 7, "unknown-2r-002-sawtooth_cogging")
    assert all(f.confidence < 0.7 for f in result.findings)


@not_yet
def test_start_up_friction_is_all_that_moves_with_pauses_lack(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Both are found, and the verdict is unknown."""
    result = diagnose(simulated(tmp_path_factory, STARTUP), apply=True)
    assert set(added(result)) == {"coulomb_friction:joint1", "startup_friction:joint1"}
    assert result.steps[-1].verdict == "nothing-missing"
