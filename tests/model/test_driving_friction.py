"""Friction that differs with who drives: its law, what resembles it, and finding it in independent data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from independent.cases import make_case

from flexviz.analysis.diagnosis import Finding, diagnose
from flexviz.data.measurements import read_set
from flexviz.model.effects import EFFECTS, kin
from flexviz.model.effects.effect import EffectEvidence
from flexviz.model.simulation import laws
from tests.cases import study

EFFECT = EFFECTS["driving_friction"]


def test_each_quadrant_has_its_own_share() -> None:
    """Lifting 10 Nm at ± 1 rad/s: the motor drives where torque and velocity agree."""
    law = laws.driving_friction(0.1, 0.3)
    found = [law(0.0, 0.0, v, load) for load, v in ((10, 1), (10, -1), (-10, -1), (-10, 1), (10, 0))]
    assert found == pytest.approx([1.0, -3.0, -1.0, 3.0, 0.0])


def test_it_is_friction_by_load_and_a_gain_in_motion() -> None:
    """(1 + g) τ = s + μ |s| sign(θ̇) and τ = s + u with the merged values are the same line τ(s)."""
    mean, gain, load = 0.08, 0.03, 20.0
    motor, back = EFFECT.merged(
        {"load_dependent_friction": np.array([mean]), "torque_gain": np.array([gain])}
    )
    law = laws.driving_friction(float(motor), float(back))
    for velocity in (1.0, -1.0):
        recorded = (load + mean * load * velocity) / (1 + gain)
        assert load + law(0.0, 0.0, velocity, load) == pytest.approx(recorded, rel=1e-12)


@pytest.mark.parametrize(
    "values, possible", [((0.05, 0.1), True), ((0.3, 0.01), True), ((0.1, 0.0), True), ((0.9, 0.1), False)]
)
def test_friction_in_one_quadrant_is_possible_but_costs_more_than_the_simpler_law(
    values: tuple[float, float], possible: bool
) -> None:
    """Only a search that ended at the upper bound has found nothing."""
    assert EFFECT.credible(np.array(values), EffectEvidence(np.ones(3), 0.001)) == possible
    assert kin(EFFECT.name) > kin("load_dependent_friction") == 1


def added(folder: Path, seed: int, kind: str, robot: str) -> tuple[dict[str, Any], list[Finding]]:
    truth = make_case(seed, kind, robot, folder)
    found = diagnose(read_set(folder), apply=True)
    return truth, [step.added for step in found.steps if step.added is not None]


@pytest.mark.parametrize("robot, seed", [("2r", 900), study("2r", 903), study("ur5", 900), study("ur5", 903)])
def test_it_is_named_with_its_shares(robot: str, seed: int, tmp_path: Path) -> None:
    truth, found = added(tmp_path, seed, "driving_friction", robot)
    (true,) = truth["effects"]
    (one,) = [f for f in found if f.effect == "driving_friction"]
    assert one.joint == true["joint"]
    for name, value in true["parameters"].items():
        assert one.parameters[name].value == pytest.approx(value, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("robot, seed", [("2r", 900), study("2r", 903), study("ur5", 900)])
def test_friction_by_load_alone_is_not_it(robot: str, seed: int, tmp_path: Path) -> None:
    truth, found = added(tmp_path, seed, "load_dependent_friction", robot)
    assert [f.effect for f in found] == ["load_dependent_friction"]
    assert found[0].joint == truth["effects"][0]["joint"]
