"""A robot whose joints follow goals, taken to simulators: what each holds, and what it says it lacks."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import flexviz
from flexviz.base.errors import InputError
from flexviz.content.results import read_result
from flexviz.data.measurements import MeasurementSet, write_set
from flexviz.model.effects import EFFECTS, LeftOut, Written
from flexviz.model.servo import GAIN, SERVO_EFFECTS
from flexviz.outlets.exporting import Exported, IdentifiedRobot, identified_robot, write
from flexviz.outlets.exporting.coverage import SERVO_TARGETS
from flexviz.outlets.exporting.servo_values import servo_joints
from flexviz.outlets.exporting.servos.bam import parameters
from flexviz.outlets.terminal import main
from tests.independent.servo_simulator import Servo
from tests.servo_exports import both_errors, document, module
from tests.servo_sets import arm_set, pendulum_set
from tests.shared_data import REAL

mujoco = pytest.importorskip("mujoco")
DRY = {"coulomb_friction": (0.12,)}
ARMS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {  # effects of the shoulder and of the elbow
    "limits": (DRY | {"torque_limit": (2.0,), "goal_speed_limit": (1.1,)}, {"goal_lag": (0.05,)}),
    "delay": (
        {"torque_offset": (0.3,), "goal_speed_limit": (1.1,), "goal_delay": (0.02,)},
        DRY | {"torque_offset": (-0.2,), "goal_lag": (0.05,), "goal_delay": (0.03,)},
    ),
    "load": ({"load_dependent_friction": (0.3,)}, DRY | {"driving_friction": (0.1, 0.3)}),
    "speed": (
        DRY | {"stribeck_friction": (0.2, 0.15)},
        DRY | {"stribeck_friction": (0.1, 0.3), "quadratic_friction": (0.2,)},
    ),
    "python": (
        DRY | {"dead_band": (0.02,), "goal_delay": (0.03,), "goal_speed_limit": (1.1,)},
        DRY | {"goal_lag": (0.05,), "goal_speed_limit": (0.9,)},
    ),
}
SERVOS = [
    Servo(14.0, 0.03, 0.6, DRY | {"goal_delay": (0.02,), "torque_limit": (2.0,)}),
    Servo(12.0, 0.02, 0.4, DRY | {"stribeck_friction": (0.1, 0.2), "dead_band": (0.01,)}),
]


def made(folder: Path, servos: list[Servo]) -> IdentifiedRobot:
    measured = arm_set(folder, servos, 6.0)
    return identified_robot(measured, document(measured.joints, servos))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> IdentifiedRobot:
    return made(tmp_path_factory.mktemp("arm"), SERVOS)


@pytest.fixture(scope="module")
def done(arm: IdentifiedRobot, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return write(arm, tmp_path_factory.mktemp("exported") / "out")


@pytest.mark.parametrize("effect", (GAIN, *SERVO_EFFECTS))
def test_every_effect_of_a_servo_states_its_targets(effect: str) -> None:
    stated = EFFECTS[effect].servo_targets
    assert set(stated) == set(SERVO_TARGETS)
    for entry in stated.values():
        texts = (entry.because,) if isinstance(entry, LeftOut) else (entry.meaning,)
        assert all(len(text) > 5 and not text.endswith(".") for text in texts)


def test_the_page_has_a_row_of_every_effect() -> None:
    text = (Path(__file__).parents[2] / "docs" / "exporting.md").read_text(encoding="utf-8")
    section = text.split("## Servos")[1].split("\n## ")[0]
    for name in (GAIN, *SERVO_EFFECTS):
        (row,) = (line for line in section.splitlines() if line.startswith(f"| {EFFECTS[name].title} |"))
        cells = [cell.strip() for cell in row.strip("|").split("|")][1:]
        for target, cell in zip(("mjcf", "isaac", "bam", "urdf"), cells, strict=True):
            entry = EFFECTS[name].servo_targets[target]
            if isinstance(entry, Written):
                assert cell == entry.meaning + (" (in part)" if entry.missing else "")
            else:
                assert cell == ("in Python" if "Python file" in entry.remedy else "–")


def test_what_mujoco_holds_is_checked_here() -> None:
    checked = {name for pair in ARMS.values() for laws in pair for name in laws} | {GAIN, "cable_spring"}
    written = {
        name for name in (GAIN, *SERVO_EFFECTS) if isinstance(EFFECTS[name].servo_targets["mjcf"], Written)
    }
    assert written <= checked and set(SERVO_EFFECTS) <= checked


@pytest.mark.parametrize("case", ARMS)
def test_mujoco_moves_as_the_servos_do(case: str, tmp_path: Path) -> None:
    """Free motion from the goals, held out: the data are the truth's; flexviz simulates them, too."""
    servos = [Servo(14.0, 0.03, 0.6, ARMS[case][0]), Servo(12.0, 0.02, 0.4, ARMS[case][1])]
    robot = made(tmp_path, servos)
    exported = write(robot, tmp_path / "out", ["mjcf"])
    there, own, _ = both_errors(robot, exported, ["g1"])
    held_out = robot.measurements.groups[1]
    following = np.std(held_out.theta_ref - held_out.joined("theta"), axis=0)  # type: ignore[operator]
    assert np.all(there < 0.02 * following) and np.all(own < 0.06 * following)
    assert np.all(there < 1.1 * own + 0.01 * following)


def test_what_mjcf_cannot_say_is_in_the_file_next_to_it(tmp_path: Path) -> None:
    robot = made(tmp_path, [Servo(14.0, 0.03, 0.6, ARMS["python"][0]), Servo(effects=ARMS["load"][1])])
    exported = write(robot, tmp_path / "out", ["mjcf"])
    assert [line.split(":")[0] for line in exported.left_out["mjcf"]] == [
        "dead_band", "driving_friction", "goal_delay", "goal_speed_limit",
    ]  # fmt: skip
    assert all("the Python file next to the model" in line for line in exported.left_out["mjcf"])
    text = exported.files["mjcf"][0].read_text(encoding="utf-8")
    assert text.count("NOT CONTAINED") == 4 and "slewmax" not in text and " delay=" not in text
    steps = module(exported.files["mjcf"][1])
    assert steps.HALF_WIDTH.tolist() == [0.02, 0.0] and steps.DELAY.tolist() == [0.03, 0.0]
    assert steps.MOTOR_DRIVING.tolist() == [0.0, 0.1] and steps.LOAD_DRIVING.tolist() == [0.0, 0.3]


def test_servos_that_mjcf_describes_need_no_python(tmp_path: Path) -> None:
    exported = write(made(tmp_path, [Servo(effects=DRY), Servo()]), tmp_path / "out", ["mjcf"])
    assert [file.name for file in exported.files["mjcf"]] == ["arm.xml"]
    assert exported.left_out["mjcf"] == ()


def test_a_spring_and_the_joints_limits_are_the_models(tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, Servo(), seconds=4.0)
    result = document(["hinge"], [Servo()]).to_dict()
    spring = {"stiffness": {"value": 1.5, "unit": "Nm/rad"}, "rest_angle": {"value": 0.0, "unit": "rad"}}
    result["effects"].append({"effect": "cable_spring", "joint": "hinge", "parameters": spring})
    robot = identified_robot(measured, flexviz.ResultDocument.from_dict(result))
    exported = write(robot, tmp_path / "out", ["mjcf"])
    model = mujoco.MjModel.from_xml_path(str(exported.files["mjcf"][0]))
    data = mujoco.MjData(model)
    data.qpos[0] = 0.4
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[0] == pytest.approx(-0.6) and model.jnt_range[0].tolist() == [-3.0, 3.0]


def test_a_light_servo_gets_a_step_that_resolves_it(tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, Servo(), seconds=4.0)
    robot = identified_robot(measured, document(["hinge"], [Servo(gain=9000.0, armature=1e-3)]))
    text = write(robot, tmp_path / "out", ["mjcf"]).files["mjcf"][0].read_text(encoding="utf-8")
    (option,) = ElementTree.fromstring(text).iter("option")
    assert float(option.attrib["timestep"]) <= 0.3 * np.sqrt((1e-3 + 4.2e-3) / 9000.0)


def test_isaac_labs_actuators_have_their_intervals(
    done: Exported, arm: IdentifiedRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, actuators = ModuleType("isaaclab"), ModuleType("isaaclab.actuators")
    for kind in ("ImplicitActuatorCfg", "DelayedPDActuatorCfg"):
        setattr(actuators, kind, lambda kind=kind, **values: SimpleNamespace(kind=kind, **values))
    monkeypatch.setitem(sys.modules, "isaaclab", package)
    monkeypatch.setitem(sys.modules, "isaaclab.actuators", actuators)
    found = module(done.files["isaac"][0])
    shoulder, elbow = found.ACTUATORS.values()
    assert (shoulder.kind, elbow.kind) == ("DelayedPDActuatorCfg", "ImplicitActuatorCfg")
    assert (shoulder.min_delay, shoulder.max_delay) == (3, 5)  # 20 ms ± 10 % in steps of 5 ms
    assert shoulder.stiffness == {"shoulder": 14.0} and shoulder.effort_limit == {"shoulder": 2.0}
    assert elbow.friction == {"elbow": 0.22} and elbow.dynamic_friction == {"elbow": 0.12}
    assert elbow.viscous_friction == {"elbow": 0.4} and not hasattr(elbow, "effort_limit_sim")
    low, high = found.INTERVALS["stiffness"]["shoulder"]
    assert low * high == pytest.approx(14.0**2, rel=1e-3) and high / 14.0 == pytest.approx(
        np.exp(1.96 * 0.05), rel=1e-3
    )
    assert found.INTERVALS["delay"]["shoulder"] == pytest.approx((0.01804, 0.02196), rel=1e-3)
    assert [line.split(":")[0] for line in done.left_out["isaac"]] == [
        "goal_delay", "stribeck_friction", "dead_band",
    ]  # fmt: skip


def test_a_value_that_the_data_do_not_determine_has_no_interval(tmp_path: Path) -> None:
    measured = pendulum_set(tmp_path, Servo(), seconds=4.0)
    result = document(["hinge"], [Servo()]).to_dict()
    for one in result["parameters"]:
        one |= {"identifiable": "no", "std": None}
    robot = identified_robot(measured, flexviz.ResultDocument.from_dict(result))
    assert set(servo_joints(robot)[0].intervals.values()) == {None}
    assert any(line.startswith("Scale of hinge not determined") for line in robot.heading)


@pytest.mark.parametrize("forth, back", [(0.3, 0.3), (0.4, 0.2), (0.1, 0.15)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_bams_load_friction_is_the_same_in_slow_motion(forth: float, back: float, way: float) -> None:
    joint = SimpleNamespace(
        has=lambda name: False, values={},
        get=lambda name: {"motor_driving": forth, "load_driving": back}.get(name.split(".")[-1], 0.0),
    )  # fmt: skip
    found = parameters(joint)  # type: ignore[arg-type]
    load = 2.0  # [Nm] that gravity pulls down with; up, the motor drives
    friction = (forth if way > 0 else back) * load
    motor, external = load + way * friction, -load
    budget = abs(external * found["load_friction_external"] - motor * found["load_friction_motor"])
    assert found["model"] == "m5" and budget == pytest.approx(friction)


def test_bams_document_says_what_a_motor_constant_is_needed_for(done: Exported) -> None:
    found = json.loads(done.files["bam"][0].read_text(encoding="utf-8"))
    assert {"kt", "R", "friction_viscous"} <= found["to_add"].keys()
    shoulder, elbow = found["joints"]["shoulder"], found["joints"]["elbow"]
    assert (shoulder["model"], elbow["model"]) == ("m1", "m2")
    assert (shoulder["friction_base"], shoulder["command_delay"]) == (0.12, 0.02)
    assert (elbow["friction_stribeck"], elbow["dtheta_stribeck"], elbow["alpha"]) == (0.1, 0.2, 2.0)
    assert shoulder["identified"] == {"gain": 14.0, "torque_limit": 2.0}


def test_a_urdf_gets_friction_and_lists_the_rest(done: Exported, arm: IdentifiedRobot) -> None:
    root = ElementTree.parse(done.files["urdf"][0]).getroot()
    rows = [joint.find("dynamics").attrib for joint in root.iter("joint")]  # type: ignore[union-attr]
    assert rows == [{"damping": "0.6", "friction": "0.12"}, {"damping": "0.4", "friction": "0.12"}]
    masses = [float(one.attrib["value"]) for one in root.iter("mass")]
    assert masses == [0.5, 0.3]
    text = done.files["urdf"][0].read_text(encoding="utf-8")
    assert all(line.replace("--", "- -") in " ".join(text.split()) for line in done.left_out["urdf"])
    assert len(done.left_out["urdf"]) == 5


@pytest.mark.parametrize("target", ["json", "yaml"])
def test_parameters_come_back(done: Exported, arm: IdentifiedRobot, target: str) -> None:
    again = identified_robot(arm.measurements, read_result(done.files[target][0]))
    assert again.model.effects == arm.model.effects
    np.testing.assert_array_equal(again.model.motor_inertia, arm.model.motor_inertia)


def test_a_format_of_torques_is_refused(arm: IdentifiedRobot, tmp_path: Path) -> None:
    with pytest.raises(InputError, match='format "c" does not exist; valid: urdf, mjcf, isaac, bam'):
        write(arm, tmp_path / "out", ["c"])
    assert not (tmp_path / "out").exists()


def test_the_command_line_prints_what_is_not_contained(
    tmp_path: Path, done: Exported, capsys: pytest.CaptureFixture[str]
) -> None:
    write_set(tmp_path / "set", arm_set(tmp_path, SERVOS, 6.0))
    command = ["export", str(tmp_path / "set"), "--result", str(done.files["json"][0])]
    assert main([*command, "--out", str(tmp_path / "out"), "--to", "isaac", "--to", "mjcf"]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert "not contained: dead_band:elbow (half_width 0.01 rad): its actuators have no dead band" in words
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [
        "arm.xml", "arm_actuators.py", "arm_servos.py",
    ]  # fmt: skip


def test_an_identified_servo_moves_as_flexviz_simulates(tmp_path: Path) -> None:
    hidden = {"coulomb_friction": (0.12,), "goal_speed_limit": (1.1,), "torque_limit": (1.5,)}
    measured = pendulum_set(tmp_path, Servo(12.0, 0.02, 0.5, hidden))
    result = flexviz.identify(measured, effects=list(hidden))
    exported = flexviz.export(measured, result, tmp_path / "out", "mjcf")
    there, own, _ = both_errors(identified_robot(measured, result), exported, ["g2"])
    group = measured.groups[2]
    following = np.std(group.theta_ref - group.joined("theta"))  # type: ignore[operator]
    assert own[0] < 0.01 * following and abs(there[0] - own[0]) < 0.01 * following


SO101 = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]


def so101(groups: list[str], held_out: str) -> MeasurementSet:
    """Recordings of an SO-101, whose servos are alike."""
    parquet = pytest.importorskip("pyarrow.parquet")

    def run(name: str) -> dict[str, Any]:
        table = parquet.read_table(REAL / "so101" / f"{name}.parquet").to_pydict()
        names = {"theta_ref": "goal_position", "theta": "present_position"}
        angles = {key: np.column_stack([table[f"{x}.{j}"] for j in SO101]) for key, x in names.items()}
        return {"time": np.array(table["time"]), **angles}

    runs = {name: run(name) for name in (*groups, held_out)}
    drive: Any = {"from": "goal", "same": [SO101]}
    urdf = REAL / "so101" / "so101.urdf"
    return MeasurementSet.from_arrays(urdf, runs, joints=SO101, validation=held_out, drive=drive)


@pytest.mark.slow
@pytest.mark.skipif(not (REAL / "so101").is_dir(), reason="no recordings of an SO-101")
def test_a_real_arm_in_mujoco_errs_as_flexviz_own_simulation(tmp_path: Path) -> None:
    """Every joint within 10 % on a motion that was held out, all joints coupled by MuJoCo's own masses."""
    measured = so101(["large_amplitude", "friction_gravity"], "multisine")
    effects = ["coulomb_friction", "load_dependent_friction", "goal_speed_limit"]
    result = flexviz.identify(measured, effects=effects)
    robot = identified_robot(measured, result)
    exported = write(robot, tmp_path / "out", ["mjcf"])
    there, own, _ = both_errors(robot, exported, ["multisine"])
    np.testing.assert_allclose(there, own, rtol=0.1)
    assert own.mean() < 0.009
