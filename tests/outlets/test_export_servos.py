"""A robot whose joints follow goals, taken to simulators."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flexviz
from flexviz.base.errors import InputError
from flexviz.model.simulation import replay
from tests.independent.servo_simulator import Servo
from tests.servo_sets import pendulum_set

mujoco = pytest.importorskip("mujoco")
HIDDEN = {"coulomb_friction": (0.12,), "goal_speed_limit": (1.1,), "torque_limit": (1.5,)}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[flexviz.MeasurementSet, flexviz.Identification]:
    measured = pendulum_set(tmp_path_factory.mktemp("set"), Servo(12.0, 0.02, 0.5, HIDDEN))
    return measured, flexviz.identify(measured, effects=list(HIDDEN))


def limited(goals: np.ndarray, step: float, speed: float) -> np.ndarray:
    """Goals (N,) that are approached at a limited speed: what MuJoCo's actuator does not do."""
    out = goals.copy()
    for k in range(1, len(out)):
        out[k] = out[k - 1] + np.clip(goals[k] - out[k - 1], -speed * step, speed * step)
    return out


def test_mujoco_moves_as_flexviz_simulates(
    found: tuple[flexviz.MeasurementSet, flexviz.Identification], tmp_path: Path
) -> None:
    measured, result = found
    done = flexviz.export(measured, result, tmp_path / "out", "mjcf")
    assert [line.split(" ")[0] for line in done.left_out["mjcf"]] == ["goal_speed_limit:hinge"]
    model = mujoco.MjModel.from_xml_path(str(done.files["mjcf"][0]))
    group = measured.groups[2]
    own = replay(measured.robot, result.model, group)
    data, per = mujoco.MjData(model), round(group.segments[0].step / model.opt.timestep)
    speed = result["goal_speed_limit.speed", "hinge"].value
    goals = limited(np.repeat(group.theta_ref[:, 0], per), model.opt.timestep, speed)  # type: ignore[index]
    data.qpos[0], theta = own.theta[0, 0], []
    for k, goal in enumerate(goals):
        if k % per == 0:
            theta.append(data.qpos[0])
        data.ctrl[0] = goal
        mujoco.mj_step(model, data)
    measured_angle = group.joined("theta")[:, 0]
    errors = [
        np.sqrt(np.mean((one[100:] - measured_angle[100:]) ** 2))
        for one in (np.array(theta), own.theta[:, 0])
    ]
    following = np.std(group.theta_ref[:, 0] - measured_angle)  # type: ignore[index]
    assert errors[1] < 0.01 * following and abs(errors[0] - errors[1]) < 0.01 * following


def test_actuators_have_their_spreads(
    found: tuple[flexviz.MeasurementSet, flexviz.Identification], tmp_path: Path
) -> None:
    measured, result = found
    done = flexviz.export(measured, result, tmp_path / "out", ["isaac", "bam"])
    text = done.files["isaac"][0].read_text(encoding="utf-8")
    compile(text, "actuators.py", "exec")
    values: dict[str, object] = {}
    exec(text.partition("# half of the")[2].partition("\n")[2], values)
    spread = values["HALF_WIDTHS"]["stiffness"]["hinge"]  # type: ignore[index]
    assert spread == pytest.approx(1.96 * result["position_control.gain", "hinge"].std, rel=1e-3)
    document = json.loads(done.files["bam"][0].read_text(encoding="utf-8"))
    assert document["joints"]["hinge"]["friction_base"] == result["coulomb_friction.coulomb", "hinge"].value
    assert len(document["not_contained"]) == 1


def test_a_format_of_torques_is_refused(
    found: tuple[flexviz.MeasurementSet, flexviz.Identification], tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="valid: mjcf, isaac, bam"):
        flexviz.export(*found, tmp_path / "out", "c")
    assert not (tmp_path / "out").exists()
