"""What the diagnosis does not get right yet, or only just does.

Each open case takes up to a minute or two, and runs with the long tests (`make slow`). A case that passes
moves to the tests of its subject.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flexviz.diagnosis.motion_fit import MotionContext

from benchmarks.diagnosis_study.cases import selected
from benchmarks.diagnosis_study.making import case_folder, make
from flexviz.diagnosis import Diagnosis, diagnose
from flexviz.diagnosis.coarse import Coarse
from flexviz.diagnosis.criterion import gain
from flexviz.diagnosis.elimination import eliminate
from flexviz.diagnosis.resolution import without
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout, layout_of
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from tests.cases import slow
from tests.planar_arm import HELD_OUT, planar_set
from tests.test_elimination import COULOMB, HIDDEN, OFFSETS, QUADRATIC, SIZES, TRIED, Linear, arm_with, same
from tests.test_startup_friction import HIDDEN as STARTUP
from tests.test_startup_friction import simulated
from tests.test_varying_size import with_growing_friction
from tests.unknown_laws import Rough, set_with

BY_LOAD = "load_dependent_friction:joint2"
OPEN = pytest.mark.xfail(strict=True, reason="not right yet"), pytest.mark.slow


def not_yet(case: Any) -> Any:
    """An open case: it runs with the long tests, and fails once it is right."""
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


def test_no_parameter_leaves_its_bounds() -> None:
    """What would stand in for an effect stays at its bound, and all others move again."""
    free = Linear.made(SIZES)
    step = free.solved([COULOMB[1]]) - free.data.x
    k = int(np.argmax(np.where(np.arange(len(step)) < free.layout.effect_start, step, 0)))
    limit = float(free.data.x[k] + 0.3 * step[k])
    problem = Linear.made(SIZES, upper={k: limit})
    found = eliminate(problem.data, lambda layout: layout.effects, (), TRIED)
    assert problem.solved([COULOMB[1]])[k] == pytest.approx(limit)
    same(found.kept[COULOMB[1]], problem.need(COULOMB[1]))


def test_a_drop_with_another_effect_at_its_bound_agrees_with_a_fit(tmp_path: Path) -> None:
    """Whatever the order of the effects."""
    measurements = arm_with(tmp_path / "set", 1.0)
    own = layout_of(measurements)
    view = Coarse(MotionContext(measurements, own.joints, stand_ins=True), own, lambda _: None)
    for effects in ((*HIDDEN, OFFSETS[1], QUADRATIC[0]), (QUADRATIC[0], OFFSETS[1], *HIDDEN)):
        layout = Layout(own.joints, effects)
        model = view.fit(layout, view.context.start(layout).x)
        found = eliminate(view.linearised(model), lambda layout: layout.effects, (), view.tried).kept
        rest = without(layout, [COULOMB[1]])
        smaller = view.fit(rest, rest.vector(layout.model(model.fit.x)))
        expected = gain(smaller.likelihood, model.likelihood, view.tried).delta
        assert found[COULOMB[1]].delta == pytest.approx(expected, rel=0.1)


def test_an_effect_is_not_dropped_for_a_tenth_of_a_nat_in_held_out_groups(demo: MeasurementSet) -> None:
    """Coulomb friction beside a free curve gains 1300 nats; held-out groups lose 0.15 ± 0.07."""
    own = Layout(demo.joints)
    view = Coarse(MotionContext(demo, own.joints, stand_ins=True), own, lambda _: None)
    bare = view.bare()
    (beside,) = view.unknowns(bare)
    assert ChosenEffect("coulomb_friction", 1) in view.parts(beside(bare))


# -- stopping, errors, trace


def test_a_stop_without_apply_gives_a_result(demo: MeasurementSet) -> None:
    assert diagnose(demo, should_stop=lambda: True).stopped


@not_yet
def test_the_present_model_has_one_error(demo: MeasurementSet) -> None:
    """Of the identification and of the first step: the app shows both."""
    from flexviz.diagnosis import prediction_errors

    errors = prediction_errors(demo, identify(demo).model)
    assert diagnose(demo).steps[0].rms_validation == pytest.approx(errors.rms_validation, rel=0.01)


@pytest.mark.slow
def test_accepted_moves_lead_to_the_model(demo: MeasurementSet) -> None:
    """Those beside an unknown input that was refused were not made."""
    result = diagnose(with_growing_friction(demo, 0.4, along_load=True), apply=True)
    have = set(added(result))
    removed = {text for move in result.trace if move.accepted for text in move.removed}
    made = {text for move in result.trace if move.accepted for text in move.added}
    assert made - removed <= have


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
def test_backlash_beside_quadratic_friction(tmp_path: Path) -> None:
    result = studied(tmp_path, 107, "pair-2r-002-backlash+quadratic_friction")
    assert set(added(result)) == {"backlash:joint1", "quadratic_friction:joint1"}


@not_yet
def test_imitations_of_a_law_of_no_library_are_not_stated_surely(tmp_path: Path) -> None:
    result = studied(tmp_path, 7, "unknown-2r-002-sawtooth_cogging")
    assert all(f.confidence < 0.7 for f in result.findings)


@not_yet
def test_start_up_friction_is_all_that_moves_with_pauses_lack(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """A contact is added at the fine resolution, and the verdict is unknown."""
    result = diagnose(simulated(tmp_path_factory, STARTUP), apply=True)
    assert set(added(result)) == {"coulomb_friction:joint1", "startup_friction:joint1"}
    assert result.steps[-1].verdict == "nothing-missing"
