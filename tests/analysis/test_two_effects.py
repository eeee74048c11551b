"""Two effects of which one hides the other."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.diagnosis_study.cases import selected
from benchmarks.diagnosis_study.making import case_folder, make
from flexviz.analysis.diagnosis import diagnose
from flexviz.data.measurements import read_set


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "name", "sure"),
    [
        (79, "pair-2r-032-motor_coupling+stribeck_friction", None),  # both at one place
        (79, "pair-2r-015-stribeck_friction+quadratic_friction", 1),
        (107, "pair-2r-010-cable_spring+friction_drift", 1),  # a ripple fits better than the spring alone
        (107, "pair-2r-002-backlash+quadratic_friction", None),
    ],
)
def test_two_effects_are_found(seed: int, name: str, sure: int | None, tmp_path: Path) -> None:
    (case,) = selected(seed, name)
    make(tmp_path, case)
    result = diagnose(read_set(case_folder(tmp_path, name)), apply=True)
    assert {step.added.effect for step in result.steps if step.added} == set(case.effects)
    assert result.steps[-1].verdict == "nothing-missing"
    assert result.findings and all(finding.confidence > 0.9 for finding in result.findings[:sure])
