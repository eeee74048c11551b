"""Which stiffness a result believes: intervals with a missing effect, and link encoders beside them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.estimation.model_error import student_factor
from flexviz.analysis.identification import Identification, identify
from flexviz.base.statistics import NORMAL_95
from flexviz.content.results import LinkSide
from flexviz.data.measurements import MeasurementSet, read_set
from tests.analysis.test_where import Law, slow_friction, with_hidden

TRUE = {"joint1": 1000.0, "joint2": 1100.0}  # [Nm/rad]


@pytest.fixture(scope="module")
def demo() -> MeasurementSet:
    """A planar arm with link encoders and joint torques, and Coulomb friction that its model lacks."""
    return read_set(Path(__file__).parents[2] / "sessions" / "planar-2r-demo")


@pytest.fixture(scope="module")
def without_friction(demo: MeasurementSet) -> Identification:
    return identify(demo)


def test_a_missing_effect_widens_the_intervals(without_friction: Identification) -> None:
    """They hold the truth or say nothing; a stiffness that may be infinite is above something."""
    assert without_friction["stiffness", "joint1"].identifiable == "weak"
    for joint, true in TRUE.items():
        found = without_friction["stiffness", joint]
        assert found.identifiable != "yes"
        if found.identifiable == "no" and found.rigid_above is None:
            assert np.isnan(found.std)  # nothing is said of it
        elif found.rigid_above is None:
            assert abs(found.value - true) < NORMAL_95 * found.std < 0.5 * true
        else:
            assert 0.3 * true < found.rigid_above < true


MISSING: dict[str, Law] = {
    "coulomb": lambda time, theta, velocity: 1.5 * np.tanh(velocity / 0.005),
    "stribeck": slow_friction,
    "ripple": lambda time, theta, velocity: np.sin(5 * theta + 0.3),
    "quadratic": lambda time, theta, velocity: velocity * np.abs(velocity),
}


def test_intervals_with_a_missing_effect_hold_the_truth_as_often_as_they_say(demo: MeasurementSet) -> None:
    """Nor are they much wider than the errors: friction, ripple and drag that the model lacks."""
    truth = json.loads((demo.path / "truth.json").read_text())["parameters"]
    true = {(p["name"], p["joint"]): p["value"] for p in truth}
    for joint in demo.joints:
        sides = (true[f"{side}_viscous_friction", joint] for side in ("link", "motor"))
        true["viscous_friction_sum", joint] = sum(sides)
    fitted = replace(demo, groups=demo.groups[:3])
    errors = []  # in standard errors
    both = [(name, joint) for name in ("stribeck", "ripple") for joint in (0, 1)]
    for name, joint in (*both, ("coulomb", 0), ("quadratic", 1)):
        hidden = with_hidden(fitted, joint, MISSING[name])
        found = identify(hidden, effects=["coulomb_friction:joint2"], refine=False)
        errors += [
            (p.value - true[p.name, p.joint]) / p.std
            for p in found.parameters
            if p.name in ("stiffness", "motor_inertia", "viscous_friction_sum") and p.identifiable != "no"
        ]
    assert len(errors) >= 24
    assert np.mean(np.abs(errors) < NORMAL_95) > 0.85
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.5


def test_the_right_model_keeps_narrow_intervals(demo: MeasurementSet) -> None:
    right = identify(demo, effects=["coulomb_friction:joint2"], refine=True)
    for joint, true in TRUE.items():
        found = right["stiffness", joint]
        assert found.identifiable == "yes"
        assert abs(found.value - true) < 3 * found.std < 2e-3 * true


def test_student_factor() -> None:
    total = np.array([4.0, 4.0, 4.0])
    parts = np.array([[4.0, 0.0, 1e-4], [0.0, 0.0, 0.0]])
    one, none, negligible = student_factor(total, parts)
    assert one == pytest.approx(12.706 / 1.96, rel=1e-3)  # one degree of freedom
    assert none == negligible == 1.0


def _changed(measurements: MeasurementSet, late: float, torque: bool) -> MeasurementSet:
    """The set with link encoders `late` [s], with or without its joint torque sensors."""
    groups = []
    for group in measurements.groups:
        assert group.q is not None and group.tau_joint is not None
        q = [np.interp(group.time - late, group.time, column) for column in group.q.T]
        sensor = group.tau_joint if torque else None
        groups.append(replace(group, q=np.stack(q, axis=1), tau_joint=sensor))
    return replace(measurements, groups=tuple(groups))


@pytest.mark.parametrize("torque", [True, False])
def test_link_encoders_show_the_stiffness(demo: MeasurementSet, torque: bool) -> None:
    changed = _changed(demo, 0.003, torque)
    found = identify(changed, effects=["coulomb_friction:joint2"]).link_side
    assert [entry.joint for entry in found] == ["joint1", "joint2"]
    for entry in found:
        assert entry.torque == ("measured" if torque else "computed")
        assert entry.low is not None and entry.high is not None and entry.stiffness is not None
        true = TRUE[entry.joint]
        assert entry.stiffness == pytest.approx(true, rel=1e-3) or entry.low < true < entry.high
        assert entry.high < 1.1 * entry.low
        if torque:  # viscous friction of the link, which is not computed, looks like a lag
            assert entry.lag == pytest.approx(0.003, abs=1e-4)


def test_a_motor_side_that_the_link_encoder_excludes_is_not_trusted(demo: MeasurementSet) -> None:
    groups = []
    for group in demo.groups:
        assert group.q is not None
        theta = np.stack([np.interp(group.time, s.time, s.theta[:, 0]) for s in group.segments[:1]])
        q = group.q.copy()
        q[:, 0] = theta[0] - 0.1 * (theta[0] - q[:, 0])  # ten times as stiff as it is
        groups.append(replace(group, q=q))
    found = identify(replace(demo, groups=tuple(groups)), effects=["coulomb_friction:joint2"])
    one, two = found.link_side
    assert not one.agrees and two.agrees
    text = found.summary(200)
    assert "link encoder (95 % interval)" in text and text.count("do not trust the motor side") == 1


def test_without_link_encoders_nothing_is_said(demo: MeasurementSet) -> None:
    groups = tuple(replace(g, q=None, tau_joint=None) for g in demo.groups)
    found = identify(replace(demo, groups=groups), effects=["coulomb_friction:joint2"])
    assert found.link_side == () and "link_side" not in found.to_dict()
    assert "link encoder" not in found.summary(200)


def test_open_intervals_are_said() -> None:
    def shown(stiffness: float | None, low: float | None, high: float | None) -> str:
        entry = LinkSide(
            joint="j", torque="computed", stiffness=stiffness, low=low, high=high, hysteresis=0.0,
            lag=0.0, agrees=True,
        )  # fmt: skip
        return entry.text

    assert shown(2e6, 1e6, 4e6) == "2.00 (1.00 … 4.00) MNm/rad"
    assert shown(None, 5e3, None) == "at least 5.00 kNm/rad"
    assert shown(None, None, None) == "not shown"
