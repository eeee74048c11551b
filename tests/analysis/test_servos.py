"""Joints that follow goals, simulated by MuJoCo: what is estimated, named, and said not to be determined."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexviz
from flexviz.analysis.acceptance import AcceptanceLimits, judge
from flexviz.base.errors import InputError
from flexviz.data.measurements import Drive
from flexviz.model.servo import ABSENT, NAMES, servo_model, servo_values
from flexviz.model.simulation import replay
from tests.independent.servo_simulator import STEP, Servo
from tests.servo_sets import pendulum_set

pytest.importorskip("mujoco")
SERVO = Servo(12.0, 0.02, 0.5)
HIDDEN = {"coulomb_friction": (0.12,), "goal_speed_limit": (1.1,)}
OWN = ("position_control.gain", "motor_inertia", "motor_viscous_friction")


def near(result: object, name: str, value: float, standard_errors: float = 4.0) -> bool:
    found = result[name, "hinge"]  # type: ignore[index]
    return abs(found.value - value) < max(standard_errors * found.std, 0.005 * abs(value))


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> flexviz.Diagnosis:
    folder = tmp_path_factory.mktemp("hidden")
    return flexviz.diagnose(pendulum_set(folder, Servo(12.0, 0.02, 0.5, HIDDEN)), apply=True)


def test_a_servo_without_effects_lacks_nothing(tmp_path: Path) -> None:
    result = flexviz.diagnose(pendulum_set(tmp_path, SERVO), apply=True)
    assert result.verdict == "nothing-missing" and not result.findings and result.limit is not None
    held = SERVO.gain * STEP / 2  # the simulated servo holds its torque for a step: half a step late
    values = (SERVO.gain, SERVO.armature, SERVO.viscous - held)
    assert all(near(result, name, value) for name, value in zip(OWN, values, strict=True))
    assert all(result[name, "hinge"].identifiable == "yes" for name in OWN)


def test_hidden_effects_are_named_with_their_sizes(hidden: flexviz.Diagnosis) -> None:
    assert hidden.verdict == "missing"
    assert {finding.effect for finding in hidden.findings} == set(HIDDEN)
    assert near(hidden, "coulomb_friction.coulomb", 0.12) and near(hidden, "goal_speed_limit.speed", 1.1)


def test_the_staircase_falls_in_rad(hidden: flexviz.Diagnosis) -> None:
    errors = [step.rms_validation[0] for step in hidden.steps if step.rms_validation]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.1 * errors[0]
    assert {step.units for step in hidden.steps} == {("rad",)}


def test_without_the_effects_the_inertia_is_wrong(hidden: flexviz.Diagnosis) -> None:
    first, last = (step.model.motor_inertia[0] for step in (hidden.steps[0], hidden.steps[-1]) if step.model)
    assert abs(last / SERVO.armature - 1) < 0.02 < 0.2 < abs(first / SERVO.armature - 1)


def test_without_a_known_mass_only_ratios_are_determined(tmp_path: Path) -> None:
    result = flexviz.identify(pendulum_set(tmp_path, SERVO, axis="0 0 1"))
    assert [result[name, "hinge"].identifiable for name in OWN] == ["no"] * 3
    assert any(fact.kind == "no-scale" for fact in result.facts)
    (ratio,) = (one for one in result.combinations if one.name.startswith("(motor_inertia"))
    assert ratio.identifiable == "yes"
    own = 0.6 * 0.08**2 + 2e-4  # of the rod, too: .6 kg at .08 m and its own inertia
    assert ratio.value == pytest.approx((SERVO.armature + own) / SERVO.gain, rel=0.005)


def test_a_stated_gain_gives_the_scale(tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, SERVO, axis="0 0 1")
    known = replace(measured, drive=Drive((SERVO.gain,)))
    result = flexviz.identify(known)
    assert result["position_control.gain", "hinge"].value == SERVO.gain
    assert near(result, "motor_inertia", SERVO.armature)
    assert result["motor_inertia", "hinge"].identifiable == "yes"


def test_a_set_with_goals_is_written_and_read(tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, SERVO, seconds=4.0)
    again = flexviz.read_set(flexviz.write_set(tmp_path / "set", measured, table_format="csv"))
    assert again.drive == measured.drive and again.rigid == ("hinge",)
    for one, other in zip(measured.groups, again.groups, strict=True):
        assert np.array_equal(one.segments[0].tau, other.segments[0].tau)
    assert "tau_" not in (tmp_path / "set" / "g0.csv").read_text(encoding="utf-8").splitlines()[0]


@pytest.mark.parametrize(
    "drive, says",
    [
        ({"from": "goal", "kp": [1.0, 2.0]}, "drive.kp"),
        ({"from": "goal", "kp": [0.0]}, "above zero"),
        ({"from": "goal", "same": [["hinge", "elbow"]]}, 'joint "elbow" is not in the set'),
        ({"from": "duty"}, "drive.from"),
        ({"kp": [1.0]}, "drive.from"),
    ],
)
def test_a_wrong_drive_is_refused(tmp_path: Path, drive: dict[str, object], says: str) -> None:
    measured = pendulum_set(tmp_path, SERVO, seconds=2.0)
    runs = {
        g.name: {"time": g.time, "theta": g.joined("theta"), "theta_ref": g.theta_ref}
        for g in measured.groups
    }
    with pytest.raises(InputError, match=says):
        flexviz.MeasurementSet.from_arrays(measured.robot, runs, drive=drive)


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda goal: np.degrees(goal), "in degrees"),
        (lambda goal: 0 * goal, "does not change"),
        (lambda goal: goal + 3.0, "is it in the unit"),
        (lambda goal: np.where(goal > 0.3, np.nan, goal), "theta_ref_hinge"),
    ],
)
def test_bad_goals_are_named(tmp_path: Path, change: object, says: str) -> None:
    measured = pendulum_set(tmp_path, SERVO, seconds=2.0)
    runs = {
        g.name: {"time": g.time, "theta": g.joined("theta"), "theta_ref": change(g.theta_ref)}  # type: ignore[operator]
        for g in measured.groups
    }
    with pytest.raises(InputError, match=says):
        flexviz.MeasurementSet.from_arrays(measured.robot, runs, drive={"from": "goal"})


def test_an_effect_that_no_goal_shows_is_refused(tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, SERVO, seconds=4.0)
    with pytest.raises(InputError, match="expected one of coulomb_friction"):
        flexviz.identify(measured, effects=["joint_damping"])


def test_a_diagnosis_can_be_stopped(tmp_path: Path) -> None:
    result = flexviz.diagnose(pendulum_set(tmp_path, SERVO, seconds=4.0), should_stop=lambda: True)
    assert result.stopped and result.verdict == "not-searched"


def test_a_model_is_replayed_from_its_goals(hidden: flexviz.Diagnosis, tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, Servo(12.0, 0.02, 0.5, HIDDEN))
    assert hidden.model is not None
    run = replay(measured.robot, hidden.model, measured.groups[2])
    error = run.theta - measured.groups[2].joined("theta")
    assert np.sqrt(np.mean(error[100:] ** 2)) == pytest.approx(hidden.steps[-1].rms_validation[0], rel=0.02)  # type: ignore[index]
    assert servo_values(servo_model(measured.robot, servo_values(hidden.model), ())) == pytest.approx(
        np.where(np.arange(len(NAMES))[:, None] < 3, servo_values(hidden.model), ABSENT[:, None])
    )


def test_limits_in_rad_are_judged_by_the_free_motion(hidden: flexviz.Diagnosis) -> None:
    error = hidden.steps[-1].rms_validation[0]  # type: ignore[index]
    for size, met in ((1.01 * error, True), (0.99 * error, False)):
        limits = AcceptanceLimits.model_validate({"default": {"held_out_angle": size}})
        (line,) = judge(hidden.document(), limits, ["hinge"]).lines
        assert (line.passed, line.unit, line.figure) == (met, "rad", pytest.approx(error))
    in_torque = AcceptanceLimits.model_validate({"default": {"held_out_torque": 1.0}})
    (line,) = judge(hidden.document(), in_torque, ["hinge"]).lines
    assert not line.passed and line.figure is None  # no torque was measured


def test_motions_are_not_designed_for_goals(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected measured torques"):
        flexviz.design(pendulum_set(tmp_path, SERVO, seconds=4.0))
