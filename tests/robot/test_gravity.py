"""A robot on a wall or under a ceiling: gravity stated in a set, a mapping, a command; carried everywhere."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from independent import files
from independent.cases import draw

from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.content.view import remedy_text
from flexviz.content.wording import mounting_text
from flexviz.data.importing import import_logs, inspect_logs, read_mapping
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects.base_tilt import BaseTilt
from flexviz.model.simulation import Plan, make_plan, tilted_gravity
from flexviz.outlets.terminal import main
from flexviz.outlets.terminal.design import mounted as mounted_plan
from flexviz.robot.mounting import DIRECTIONS, GRAVITY, checked_gravity, upright
from flexviz.robot.robot import Robot
from tests.cases import slow
from tests.import_data import STIFFNESS, truth, write_mapping, write_robot
from tests.planar_arm import shorten_presets
from tests.small_set import TOML, write_small_set

TURN = math.pi / 2
MOUNTED = {  # turns of the base about x, then about the world's y [rad] -> gravity in its frame
    (0.0, TURN): (9.81, 0.0, 0.0),
    (0.0, -TURN): (-9.81, 0.0, 0.0),
    (math.pi, 0.0): (0.0, 0.0, 9.81),
    (TURN, 0.0): (0.0, -9.81, 0.0),
    (0.0, 0.0): GRAVITY,
}


def state(folder: Path, gravity: tuple[float, ...] | None) -> Path:
    """State gravity in the set, before its joints."""
    file = folder / "measurements.toml"
    lines = [line for line in file.read_text().splitlines() if not line.startswith("gravity")]
    lines.insert(2, "" if gravity is None else f"gravity = {list(gravity)}")
    file.write_text("\n".join(lines))
    return folder


def case(folder: Path, mounted: tuple[float, float], kind: str = "none") -> Any:
    """A planar arm of the independent simulator (MuJoCo), mounted so; its set states no gravity."""
    made = draw(1, kind, "2r", noise=1.0, duration=6.0, mounted=mounted)
    files.write(folder, made.setup, made.record, made.drawn, made.rough, made.own)
    return made.setup


def excess(measurements: MeasurementSet, **options: Any) -> tuple[Any, np.ndarray]:
    """An identification, and its error ÷ the noise by joint."""
    found = identify(measurements, **options)
    return found, np.array(found.residual.rms_validation) / np.array(found.residual.noise_floor)


@pytest.mark.parametrize("mounted", [slow((0.0, TURN)), slow((0.0, -TURN)), (math.pi, 0.0)])
def test_the_parameters_are_right_with_the_stated_gravity_only(
    tmp_path: Path, mounted: tuple[float, float]
) -> None:
    true = case(tmp_path, mounted)
    found, error = excess(read_set(state(tmp_path, MOUNTED[mounted]), logged=False))
    assert found.converged and np.all(error < 1.5), error
    values = {(p.name, p.joint): p.value for p in found.parameters}
    for name in ("stiffness", "motor_inertia"):
        for joint, wanted in zip(true.arm.joints, getattr(true, name), strict=True):
            assert values[name, joint] == pytest.approx(wanted, rel=0.01)
    _, silent = excess(read_set(state(tmp_path, None), logged=False))
    assert np.all(silent > 100.0), silent


def test_base_tilt_is_relative_to_the_stated_gravity(tmp_path: Path) -> None:
    true = case(tmp_path, (0.0, TURN), "base_tilt")
    (tilt,) = (e.values for e in true.effects if e.name == "base_tilt")
    measurements = read_set(state(tmp_path, (9.81, 0.0, 0.0)), logged=False)
    found, error = excess(measurements, effects=["base_tilt"])
    assert np.all(error < 1.5), error
    value = next(p for p in found.parameters if p.name == "base_tilt.tilt_y")
    assert value.value == pytest.approx(tilt["tilt_y"], abs=4 * value.std) and value.std < 0.003


@pytest.mark.parametrize(("mounted", "gravity"), MOUNTED.items())
def test_the_base_is_turned_so_that_gravity_points_down(
    mounted: tuple[float, float], gravity: tuple[float, float, float]
) -> None:
    x, y = mounted
    about_x = np.array([[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]])
    about_y = np.array([[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]])
    np.testing.assert_allclose(upright(gravity), about_y @ about_x, atol=1e-15)
    np.testing.assert_allclose(tilted_gravity(0.0, 0.0, gravity), gravity, atol=1e-15)


def test_any_gravity_points_down_after_the_shortest_turn() -> None:
    for seed in range(20):
        gravity = 9.81 * np.random.default_rng(seed).normal(size=3)
        turn = upright(gravity)
        np.testing.assert_allclose(
            turn @ gravity, np.array([0.0, 0.0, -float(np.linalg.norm(gravity))]), atol=1e-12
        )
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        axis = np.linalg.svd(turn - np.eye(3))[2][2]
        assert abs(axis[2]) < 1e-6  # of the turn: it is level
    np.testing.assert_array_equal(upright((0.0, 0.0, 0.0)), np.eye(3))
    np.testing.assert_array_equal(upright(GRAVITY), np.eye(3))


def test_a_robot_is_drawn_as_it_is_mounted() -> None:
    robot = Robot.load("robots:planar_2r")
    standing = robot.link_poses(np.array([0.3, 0.5]))
    hanging = robot.mounted((0.0, 0.0, 9.81)).link_poses(np.array([0.3, 0.5]))
    for link, pose in standing.items():
        np.testing.assert_allclose(hanging[link], np.diag([1.0, -1.0, -1.0, 1.0]) @ pose, atol=1e-12)
    lowest = robot.mounted((9.81, 0.0, 0.0)).link_poses(np.zeros(2))  # at zero the arm points along x
    assert lowest[robot.links[-1]][2, 3] == pytest.approx(-standing[robot.links[-1]][0, 3] or -1.0, rel=0.5)
    assert robot.gravity == GRAVITY


WRONG = {
    '"down"': "expected three finite numbers",
    "[0, -9.81]": "expected three finite numbers",
    "[0, 0, nan]": "expected three finite numbers",
    "[0, 0, inf]": "expected three finite numbers",
    "[0, 0, true]": "expected three finite numbers",
    "[0, 0, 0, -9.81]": "expected three finite numbers",
    "[0, 0, -1]": "a length of 1 m/s², expected 1.5 to 30 (9.81 on Earth), or 0 without gravity",
    "[0, 0, -9810]": "a component above 30 m/s²",
    "[20, 20, 20]": "a length of 34.6 m/s²",
}


@pytest.mark.parametrize(("value", "why"), WRONG.items())
def test_an_impossible_gravity_is_refused_by_name(tmp_path: Path, value: str, why: str) -> None:
    folder = write_small_set(tmp_path / "set")
    (folder / "measurements.toml").write_text(TOML.replace("torque_hold", f"gravity = {value}\ntorque_hold"))
    with pytest.raises(InputError) as found:
        read_set(folder)
    said = str(found.value)
    assert "measurements.toml, gravity: found " in said and why in said, said
    write_robot(tmp_path)
    (tmp_path / "run.csv").write_text("t\n")
    mapping = write_mapping(tmp_path, ["run.csv"], '"q#"', '"t#"', top=f"gravity = {value}")
    with pytest.raises(InputError) as found:
        read_mapping(mapping)
    assert "gravity: found " in str(found.value) and why in str(found.value)


def test_no_gravity_is_possible() -> None:
    assert checked_gravity((0.0, 0.0, 0.0), "x") == (0.0, 0.0, 0.0)
    assert mounting_text((0.0, 0.0, 0.0)).startswith("without gravity, gravity = [0, 0, 0]")
    robot = Robot.load("robots:planar_2r").mounted((0.0, 0.0, 0.0))
    still = np.zeros((1, 2))
    np.testing.assert_array_equal(robot.cad_torques((), still, still, still), 0.0)


def test_how_it_is_mounted_in_words() -> None:
    words = [mounting_text(gravity).partition(", ")[0] for gravity in DIRECTIONS.values()]
    assert words == ["", "under a ceiling", *["on a wall"] * 4]
    assert mounting_text((0.0, -1.7, -9.66)).partition(", ")[0] == "upright"
    assert mounting_text((0.0, -4.0, -8.96)) == "tilted, gravity = [0, -4, -8.96] m/s² in the base's frame"


# -- import --------------------------------------------------------------------------------------------------


def write_log(folder: Path, gravity: tuple[float, float, float]) -> Path:
    """A log of the small arm under this gravity, and its URDF."""
    write_robot(folder)
    run = truth(rows=1500)
    robot = Robot.load(folder / "robot.urdf")
    still = np.zeros_like(run.q)
    upright_torque = robot.cad_torques((), run.q, still, still)
    more = robot.mounted(gravity).cad_torques((), run.q, still, still) - upright_torque
    rows = np.column_stack((run.time, run.theta + more / STIFFNESS, run.tau + more))
    header = "time,theta_joint1,theta_joint2,tau_joint1,tau_joint2"
    np.savetxt(folder / "run.csv", rows, "%.9g", ",", header=header, comments="")
    return folder / "run.csv"


def test_a_mapping_states_gravity_and_the_set_has_it(tmp_path: Path) -> None:
    write_log(tmp_path, (9.81, 0.0, 0.0))
    signals = '"theta_joint#"', '"tau_joint#"'
    silent = write_mapping(tmp_path, ["run.csv"], *signals, time='column = "time"')
    assert import_logs(silent, None).issues, "upright, these torques contradict the robot"
    stated = write_mapping(
        tmp_path, ["run.csv"], *signals, time='column = "time"', top="gravity = [9.81, 0, 0]"
    )
    done = import_logs(stated, tmp_path / "set")
    assert not done.issues
    assert read_set(tmp_path / "set").robot.gravity == (9.81, 0.0, 0.0)
    assert "\ngravity = [9.81, 0.0, 0.0]\n" in (tmp_path / "set" / "measurements.toml").read_text()


def test_a_draft_states_gravity_and_is_checked_under_it(tmp_path: Path) -> None:
    log = write_log(tmp_path, (0.0, 0.0, 9.81))
    found = inspect_logs([log], str(tmp_path / "robot.urdf"), gravity=(0.0, 0.0, 9.81))
    assert not found.issues and not found.draft.missing
    text = found.draft.text(tmp_path / "arm.toml")
    assert '\nrobot = "robot.urdf"\ngravity = [0.0, 0.0, 9.81]\n' in text
    usual = inspect_logs([log], str(tmp_path / "robot.urdf"))
    assert "\ngravity" not in usual.draft.text(None)


def test_an_unstated_mounting_is_proposed_and_mended(tmp_path: Path) -> None:
    log = write_log(tmp_path, (0.0, 0.0, 9.81))
    found = inspect_logs([log], str(tmp_path / "robot.urdf"))
    assert [issue.kind for issue in found.issues] == ["mounting"]
    lines = found.draft.text(tmp_path / "arm.toml").splitlines()
    assert "# gravity = [0.0, 0.0, 9.81]" in lines and not any(line.startswith("gravity") for line in lines)
    (tmp_path / "arm.toml").write_text("\n".join(lines))
    mended = import_logs(tmp_path / "arm.toml", tmp_path / "set", mend=True)
    assert mended.mended == ("gravity = [0.0, 0.0, 9.81]",)
    assert "mounting" not in [issue.kind for issue in mended.issues]
    assert read_set(tmp_path / "set").robot.gravity == (0.0, 0.0, 9.81)
    # the button of the page does the same
    (remedies,) = (issue.remedies for issue in found.issues)
    assert remedy_text(remedies) == "gravity = [0.0, 0.0, 9.81]"
    found.draft.accept(remedies, "why")
    assert "\ngravity = [0.0, 0.0, 9.81]\n" in found.draft.text(tmp_path / "arm.toml")


def test_the_commands_take_gravity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path, (0.0, -9.81, 0.0))
    draft = ["import", "run.csv", "--robot", "robot.urdf"]
    assert main([*draft, "--gravity", "0", "-9.81", "0", "--mapping", "arm.toml"]) == 0
    assert read_mapping(Path("arm.toml")).gravity == [0.0, -9.81, 0.0]
    assert main(["import", "arm.toml", "--out", "one"]) == 0
    assert main([*draft, "--gravity", "0", "-9.81", "0", "--out", "two", "--yes"]) == 0
    text = Path("arm.toml").read_text().replace("gravity = [0.0, -9.81, 0.0]\n", "")
    Path("silent.toml").write_text(text)
    assert main(["import", "silent.toml", "--gravity", "0", "-9.81", "0", "--out", "three"]) == 0
    for name in ("one", "two", "three"):
        assert read_set(name).robot.gravity == (0.0, -9.81, 0.0)
    capsys.readouterr()
    assert main([*draft, "--gravity", "0", "-1", "0", "--out", "four"]) == 2
    assert "--gravity: found 0.0, -1.0, 0.0: a length of 1 m/s²" in capsys.readouterr().err


# -- everywhere else -----------------------------------------------------------------------------------------


def test_a_simulated_set_is_mounted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_presets(monkeypatch)
    plan = make_plan("planar-2r", ["base_tilt"], gravity=(9.81, 0.0, 0.0))
    assert plan.robot.gravity == (9.81, 0.0, 0.0)
    out = str(tmp_path / "set")
    assert main(["simulate", "planar-2r", "--gravity", "9.81", "0", "0", "--out", out]) == 0
    measurements = read_set(out)
    assert measurements.robot.gravity == (9.81, 0.0, 0.0)
    assert make_plan(out).robot.gravity == (9.81, 0.0, 0.0)  # a set that is repeated
    _, error = excess(measurements)
    assert np.all(error < 1.5), error


def test_a_design_is_for_the_mounted_robot(tmp_path: Path) -> None:
    plan = mounted_plan("planar-2r", (9.81, 0.0, 0.0))
    assert isinstance(plan, Plan) and plan.robot.gravity == (9.81, 0.0, 0.0)
    assert mounted_plan("planar-2r", None) == "planar-2r"
    with pytest.raises(InputError, match="--gravity applies to a URDF or preset, but a set states its own"):
        mounted_plan(str(write_small_set(tmp_path / "set")), (9.81, 0.0, 0.0))


def test_exports_carry_gravity(tmp_path: Path) -> None:
    from flexviz.outlets.exporting import write
    from tests.exporting_cases import identified, library_link_torque, motion, plan, short_set

    mujoco = pytest.importorskip("mujoco")
    short_set("planar-2r", tmp_path)
    measurements = read_set(state(tmp_path / "planar-2r", (9.81, 0.0, 0.0)))
    for tilts in ((), ("base_tilt",)):
        made = identified(measurements, plan("planar-2r", *tilts).model)
        done = write(made, tmp_path / f"out{len(tilts)}", ["urdf", "mjcf", "python", "c", "json"])
        assert np.allclose(made.laws.gravity, (9.81, 0.0, 0.0), atol=0.0 if not tilts else 1.0)
        text = {name: file[0].read_text() for name, file in done.files.items()}
        for name in ("mjcf", "python", "urdf"):
            assert "Mounting: " in text[name] and "gravity = [9.8" in text[name], name
        assert (
            "on a wall, gravity = [9.81, 0, 0] m/s² in the base's frame: set it" in done.left_out["urdf"][-1]
        )
        _, q = motion(2)
        wanted = library_link_torque(made, np.stack([q[0], 0 * q[0], 0 * q[0]]))[::100]
        compiled = mujoco.MjModel.from_xml_path(str(done.files["mjcf"][0]))
        data, space = mujoco.MjData(compiled), {}
        rows = [compiled.joint(joint).qposadr[0] for joint in made.joints]
        exec(text["python"], space)
        for pose, torque in zip(q[0][::100], wanted, strict=True):
            data.qpos[rows] = pose
            mujoco.mj_forward(compiled, data)
            np.testing.assert_allclose(data.qfrc_bias[rows], torque, atol=1e-6)
        found = space["link_torque"](q[0][::100], 0 * q[0][::100], 0 * q[0][::100])
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_an_effect_knows_the_stated_gravity() -> None:
    tilt = BaseTilt()
    for gravity in DIRECTIONS.values():
        stated = np.array(gravity)
        np.testing.assert_allclose(tilt.gravity(np.zeros(2), stated), stated, atol=1e-15)
        turned = tilt.gravity(np.array([0.3, -0.2]), stated)
        np.testing.assert_allclose(turned, tilted_gravity(0.3, -0.2, gravity), atol=1e-14)
        assert turned @ stated / 9.81**2 == pytest.approx(math.cos(0.3) * math.cos(0.2))
    np.testing.assert_array_equal(tilt.gravity(np.array([0.3, -0.2]), np.zeros(3)), np.zeros(3))
