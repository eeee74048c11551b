"""Two effects that a search backwards does not find: a search forwards does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flexviz.diagnosis.comparison import RefittedCandidate, SearchStep, unscored
from flexviz.diagnosis.rich_result import just_incomplete

from benchmarks.diagnosis_study.cases import selected
from benchmarks.diagnosis_study.making import case_folder, make
from flexviz.diagnosis import diagnose
from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.model_family import RichModel
from flexviz.diagnosis.motion_fit import MotionContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.measurements import MeasurementSet, read_set

LIMITS = THRESHOLDS.motion


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "name"),
    [
        (79, "pair-2r-032-motor_coupling+stribeck_friction"),  # both at one place
        # ends at 17 times the noise backwards
        pytest.param(79, "pair-2r-015-stribeck_friction+quadratic_friction", marks=pytest.mark.study),
        # on both sides of one joint, with known friction
        pytest.param(107, "pair-2r-002-backlash+quadratic_friction", marks=pytest.mark.study),
        (107, "pair-2r-010-cable_spring+friction_drift"),  # a torque ripple fits better than the spring alone
    ],
)
def test_two_effects_are_found(seed: int, name: str, tmp_path: Path) -> None:
    (case,) = selected(seed, name)
    make(tmp_path, case)
    result = diagnose(read_set(case_folder(tmp_path, name)), apply=True)
    assert {step.added.effect for step in result.steps if step.added} == set(case.effects)
    assert result.steps[-1].verdict == "nothing-missing"
    assert all(step.added.confidence > 0.9 for step in result.steps if step.added)


def test_rivals_keep_their_distance_where_a_step_is_refitted(demo: MeasurementSet) -> None:
    layout = Layout(demo.joints)
    context = FitContext(demo, layout)
    rough, close = (context.fit(layout, context.start(layout).x, iterations=k) for k in (0, 2))
    mine, tied = ChosenEffect("coulomb_friction", 1), ChosenEffect("link_coulomb_friction", 1)
    chosen = RefittedCandidate(unscored(mine, rough), rough)
    step = SearchStep(rough, chosen, {mine: rough.objective, tied: rough.objective + 7})
    assert close.objective < rough.objective - 7
    again = step.refitted(rough, close)
    assert again.after is close
    assert again.objectives == pytest.approx({mine: close.objective, tied: close.objective + 7})


def test_a_search_forwards_follows_where_little_is_left(demo: MeasurementSet) -> None:
    own = Layout(demo.joints)
    context = MotionContext(demo, own.joints)
    fit = context.fit(own, context.start(own).x, iterations=0)
    curve = (ChosenEffect("free_curve_velocity", 1),)
    for ratio, curves, expected in (
        (0.9 * LIMITS.unexplained, (), False),
        (1.1 * LIMITS.unexplained, (), True),
        (1.1 * LIMITS.unexplained, curve, False),
        (1.1 * LIMITS.just_unexplained, (), False),
    ):
        fit.__dict__["rms"] = context.noise_floor * np.array([1.0, ratio])
        assert just_incomplete(RichModel(fit, {}, curves)) == expected
