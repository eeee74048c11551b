"""What the diagnosis finds in sets of the independent simulator, which shares no code with it.

A few cases run every time; `pytest -m study tests/analysis/test_diagnosis_independent.py` runs all of them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")

from independent.cases import make_case
from independent.hiding import KINDS
from independent.laws import STRANGE

from flexviz.analysis.diagnosis import Diagnosis, Finding, diagnose
from flexviz.data.measurements import read_set
from tests.cases import slow, study

# pairs that such data cannot tell apart: the twin counts where the tie is reported
TWINS = (
    {"coulomb_friction", "link_coulomb_friction"},
    {"torque_delay", "joint_damping"},
    {"torque_offset", "base_tilt"},
)
WITHOUT_JOINT = {"payload_error", "base_tilt", "torque_delay"}
DAILY, LATER = ("stiffness_hardening", 200), ("coulomb_friction", 200)
STUDY = (200, 201)


def ask(seed: int, kind: str, robot: str, folder: Path) -> tuple[dict[str, Any], Diagnosis]:
    truth = make_case(seed, kind, robot, folder)
    return truth, diagnose(read_set(folder), apply=True)


def is_it(found: Finding, true: dict[str, Any]) -> bool:
    """Whether a finding names the true effect where it is, or a twin reported as tied to it."""
    effect = true["effect"]
    anywhere = effect in WITHOUT_JOINT or found.effect in WITHOUT_JOINT
    if not anywhere and found.joint != true["joint"]:
        return False
    if found.effect == effect:
        return found.payload == true["payload"] and found.group == true["group"]
    tied = any(t.effect == effect for t in found.inseparable_from)
    return tied and {found.effect, effect} in TWINS


def check_found(truth: dict[str, Any], result: Diagnosis) -> None:
    """The effect first, nothing else, nothing left, and a smaller error on data that were held out."""
    (true,) = truth["effects"]
    assert result.verdict == "missing"
    assert is_it(result.findings[0], true), result.findings[0].text
    added = [s.added for s in result.steps if s.added is not None]
    assert all(is_it(a, true) for a in added), [a.text for a in added]
    assert result.steps[-1].verdict == "nothing-missing"
    before, after = (
        s.rms if true["effect"] == "external_contact" else s.rms_validation
        for s in (result.steps[0], result.steps[-1])
    )
    assert before is not None and after is not None
    assert np.linalg.norm(after) < 0.9 * np.linalg.norm(before)


def check_values(truth: dict[str, Any], result: Diagnosis) -> None:
    """The effect's and the joints' values, within four standard errors or 1 % (backlash 15 %)."""
    (true,) = truth["effects"]
    found = {(p.name, p.joint): p for p in result.parameters}
    joint = None if true["effect"] in WITHOUT_JOINT else true["joint"]
    share = 0.15 if true["effect"] == "backlash" else 0.01
    values = dict(true["parameters"])
    estimates = {k: found.get((f"{true['effect']}.{k}", joint)) for k in values}
    if all(estimates.values()):  # not where a twin was named
        if "phase" in values and estimates["amplitude"].value < 0:  # type: ignore[union-attr]
            values["amplitude"], values["phase"] = -values["amplitude"], values["phase"] + math.pi
        for key, value in values.items():
            p = estimates[key]
            assert p is not None
            away = p.value - value
            if key == "phase":
                away = (away + math.pi) % (2 * math.pi) - math.pi
            assert abs(away) < max(4 * p.std, share * abs(value)), (
                f"{p.name} {p.value} ± {p.std}, true {value}"
            )
    for name in ("stiffness", "motor_inertia"):
        for j, value in zip(truth["joints"], truth[name], strict=True):
            p = found[name, j]
            assert abs(p.value - value) < max(4 * p.std, 0.01 * value), f"{name} {j} {p.value}, true {value}"


@pytest.mark.parametrize(
    "kind, seed",
    [
        DAILY,
        slow(*LATER),
        *(study(kind, seed) for kind in KINDS for seed in STUDY if (kind, seed) not in (DAILY, LATER)),
    ],
)
def test_planar_arm(kind: str, seed: int, tmp_path: Path) -> None:
    truth, result = ask(seed, kind, "2r", tmp_path)
    check_found(truth, result)
    check_values(truth, result)


@pytest.mark.parametrize("seed", [300, *map(study, range(301, 306))])
def test_nothing_is_missing(seed: int, tmp_path: Path) -> None:
    truth, result = ask(seed, "none", "2r", tmp_path)
    assert result.verdict == "nothing-missing" and [s.added for s in result.steps] == [None]
    found = {(p.name, p.joint): p for p in result.parameters}
    for name in ("stiffness", "motor_inertia"):
        for joint, value in zip(truth["joints"], truth[name], strict=True):
            p = found[name, joint]
            assert abs(p.value - value) < max(5 * p.std, 0.002 * value)


STRANGE_DAILY = [("shaking", 201)]  # its neighbour is disturbed more than its joint


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind, seed",
    [*STRANGE_DAILY, *(study(k, s) for k in STRANGE for s in STUDY if (k, s) not in STRANGE_DAILY)],
)
def test_not_in_the_library(kind: str, seed: int, tmp_path: Path) -> None:
    truth, result = ask(seed, kind, "2r", tmp_path)
    assert "unknown" in {result.verdict, result.steps[-1].verdict}
    assert result.where[0].joint == truth["effects"][0]["joint"]


@pytest.mark.study
@pytest.mark.parametrize(
    "robot, kind, seed",
    [
        ("panda", "coulomb_friction", 400),
        ("panda", "none", 400),
        ("panda", "torque_ripple", 401),
        ("ur5", "load_dependent_friction", 400),
        ("ur5", "payload_error", 401),
    ],
)
def test_six_and_seven_joints(robot: str, kind: str, seed: int, tmp_path: Path) -> None:
    truth, result = ask(seed, kind, robot, tmp_path)
    if kind == "none":
        assert result.verdict == "nothing-missing" and len(result.steps) == 1
    else:
        check_found(truth, result)


@pytest.mark.study
@pytest.mark.parametrize(
    "kinds, seed", [("coulomb_friction+torque_gain", 500), ("torque_ripple+cable_spring", 501)]
)
def test_two_effects(kinds: str, seed: int, tmp_path: Path) -> None:
    truth, result = ask(seed, kinds, "2r", tmp_path)
    added = [s.added for s in result.steps if s.added is not None]
    for true in truth["effects"]:
        assert any(is_it(a, true) for a in added), [a.text for a in added]
    assert len(added) == 2 and result.steps[-1].verdict == "nothing-missing"
