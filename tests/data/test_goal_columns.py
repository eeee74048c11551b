"""Goals and positions as servos log them: units, registers that are no torque, and goals that are wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import pytest

from flexviz.base.errors import InputError
from flexviz.data.importing import edited, gaps, import_logs, inspect_logs
from flexviz.data.logs import read_mapping
from flexviz.data.measurements import read_set
from tests.controller_logs import TYPES, bag
from tests.import_data import write_lerobot_goals
from tests.shared_data import REAL

RANGES = {"pan": (-1.9, 1.9), "lift": (-1.7, 1.5), "roll": (-2.7, 2.9), "gripper": (-0.2, 1.7)}
ARM = [joint for joint in RANGES if joint != "gripper"]
COUNT = 2 * np.pi / 4096
Columns = dict[str, np.ndarray]


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """A chain of four joints with the ranges above."""
    links = ['<link name="link0"/>']
    for k, (joint, (lower, upper)) in enumerate(RANGES.items()):
        links.append(
            f'<joint name="{joint}" type="revolute"><parent link="link{k}"/><child link="link{k + 1}"/>'
            f'<origin xyz="0.1 0 0"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
            f'<limit lower="{lower}" upper="{upper}" effort="3" velocity="8"/></joint>'
            f'<link name="link{k + 1}"><inertial><origin xyz="0.05 0 0"/><mass value="0.1"/>'
            '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    file = tmp_path / "arm.urdf"
    file.write_text(f'<robot name="arm">{"".join(links)}</robot>', encoding="utf-8")
    return file


def motion(seed: int = 0) -> SimpleNamespace:
    """Positions in whole counts that follow their goals late; the gripper's are 0 … 1 of 2.2 rad."""
    time = np.arange(900) * 0.02
    rng = np.random.default_rng(seed)
    hertz = rng.uniform(0.1, 0.5, len(RANGES))

    def angles(t: np.ndarray) -> np.ndarray:
        return 0.9 * np.sin(2 * np.pi * np.multiply.outer(t, hertz)) + 0.05

    theta = np.round(angles(time - 0.08) / COUNT) * COUNT
    return SimpleNamespace(time=time, theta=theta, goal=angles(time))


def in_unit(unit: str) -> tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]:
    """What a log in a unit has of angles (N, n), and what it has of the gripper's."""
    low, high = np.array(list(RANGES.values())).T
    low, high = 1.15 * low[:3], 1.15 * high[:3]  # calibrated by hand, not the URDF's
    arm = {
        "rad": lambda x: x,
        "deg": np.degrees,
        "counts": lambda x: np.round(x / COUNT) + 2048,
        "per cent": lambda x: 200 * (x - (low + high) / 2) / (high - low),
    }[unit]
    gripper = {"rad": 1.0, "deg": 100.0, "per cent": 100.0}
    return arm, lambda x: 0.5 + x / 2.2 if unit == "rad" else (0.5 + x / 2.2) * gripper.get(unit, 1.0)


def columns_of(run: SimpleNamespace, unit: str = "rad") -> Columns:
    arm, gripper = in_unit(unit)
    columns: Columns = {"time": run.time}
    for kind, values in (("present_position", run.theta), ("goal_position", run.goal)):
        made = np.column_stack([arm(values[:, :3]), gripper(values[:, 3])])
        columns |= {f"{kind}.{joint}": made[:, j] for j, joint in enumerate(RANGES)}
    if unit == "counts":
        for kind, values in (("present_position", run.theta), ("goal_position", run.goal)):
            columns[f"{kind}.gripper"] = np.round(values[:, 3] / COUNT) + 2048
    return columns


def write(file: Path, columns: Columns) -> Path:
    papq.write_table(pa.table(columns), file)
    return file


def mapping_of(urdf: Path, logs: list[Path]) -> Path:
    """The drafted mapping of logs."""
    draft = inspect_logs(logs, str(urdf)).draft
    assert draft.drive and not draft.missing
    file = urdf.parent / "mapping.toml"
    file.write_text(draft.text(file), encoding="utf-8")
    return file


def imported(urdf: Path, logs: list[Path]) -> SimpleNamespace:
    """Joints, angles and goals of the set that a draft makes of logs, and the draft's text."""
    file = mapping_of(urdf, logs)
    done = import_logs(file, urdf.parent / "set")
    assert not done.issues
    group = read_set(urdf.parent / "set").groups[0]
    text = file.read_text(encoding="utf-8")
    return SimpleNamespace(
        joints=done.joints,
        theta=group.joined("theta"),
        goal=group.theta_ref,
        text=text,
        notes=done.groups[0].notes,
    )


@pytest.mark.parametrize("unit", ["rad", "deg", "counts", "per cent"])
def test_the_unit_is_found_and_a_gripper_in_another_is_left_out(unit: str, urdf: Path) -> None:
    run = motion()
    done = imported(urdf, [write(urdf.parent / "run.parquet", columns_of(run, unit))])
    assert list(done.joints) == (list(RANGES) if unit == "counts" else ARM)
    n = len(done.joints)
    away = (done.theta - run.theta[:, :n]).mean(axis=0)  # the zero of per cent is the URDF's, not the servo's
    assert np.abs(away).max() < (0.05 if unit == "per cent" else 2 * COUNT)
    for found, true in ((done.theta, run.theta), (done.goal, run.goal)):
        assert np.abs(found - true[:, :n] - away).max() < 2 * COUNT
    assert ("left out: gripper" in done.text) == (unit != "counts")
    assert f"# same = {json.dumps(list(done.joints))[:-1]}" in done.text.replace("[[", "[")


def test_radians_beyond_the_limits_are_no_degrees(urdf: Path) -> None:
    run = motion()
    for x in (run.theta, run.goal):
        x[:, 1] += 1.2  # of 1.5: its zero is not the URDF's
    done = imported(urdf, [write(urdf.parent / "run.parquet", columns_of(run))])
    assert np.array_equal(done.theta, run.theta[:, :3])


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
@pytest.mark.parametrize("unit", ["deg", "per cent"])
def test_lerobot_datasets_of_an_arm_with_a_gripper(version: str, unit: str, urdf: Path) -> None:
    arm, gripper = in_unit(unit)
    runs = [motion(k) for k in range(3)]
    episodes = []
    for run in runs:
        made = [np.radians(np.column_stack([arm(x[:, :3]), gripper(x[:, 3])])) for x in (run.theta, run.goal)]
        episodes.append(SimpleNamespace(time=run.time, theta=made[0], goal=made[1]))
    folder = write_lerobot_goals(urdf.parent / "dataset", episodes, version, list(RANGES))
    done = imported(urdf, [folder])
    assert list(done.joints) == ARM
    assert len(read_set(urdf.parent / "set").groups) == 3
    lead = done.goal - done.theta
    assert np.abs(lead - (runs[0].goal - runs[0].theta)[:, :3]).max() < 2 * COUNT


@pytest.mark.parametrize("goal, position", [("reference", "feedback"), ("desired", "actual")])
def test_a_trajectory_controllers_state(goal: str, position: str, urdf: Path, monkeypatch: Any) -> None:
    kind = "control_msgs/msg/JointTrajectoryControllerState"
    names = {"reference": goal, "feedback": position}
    definition = TYPES[kind]
    for name, other in names.items():
        definition = definition.replace(f"JointTrajectoryPoint {name}", f"JointTrajectoryPoint {other}")
    monkeypatch.setitem(TYPES, kind, definition)
    run = motion()
    run.theta, run.goal = run.theta[:, :3], run.goal[:, :3]

    def state(run: SimpleNamespace, k: int, header: dict[str, object]) -> dict[str, object]:
        empty = {"velocities": [], "accelerations": [], "effort": []}
        empty |= {"time_from_start": {"sec": 0, "nanosec": 0}}
        points = {goal: {"positions": [*run.goal[k]], **empty}}
        points |= {position: {"positions": [*run.theta[k]], **empty}}
        return {"header": header, "joint_names": ARM, **points}

    log = bag(urdf.parent, run, {"/arm_controller/controller_state": (kind, state)})  # type: ignore[arg-type]
    done = imported(urdf, [log])
    assert list(done.joints) == ARM
    assert np.allclose(done.goal, run.goal) and np.allclose(done.theta, run.theta)


def test_the_records_of_bam(urdf: Path, tmp_path: Path) -> None:
    run = motion()
    one = tmp_path / "one.urdf"
    text = urdf.read_text(encoding="utf-8")
    for joint in ("lift", "roll", "gripper"):
        text = text.replace(f'name="{joint}" type="revolute"', f'name="{joint}" type="fixed"')
    one.write_text(text, encoding="utf-8")
    entries = [
        {"position": p, "speed": 0.0, "load": float(100 * (g - p)), "input_volts": 7.4, "temp": 30.0,
         "timestamp": t, "goal_position": g, "torque_enable": bool(t > 1)}
        for t, p, g in zip(run.time, run.theta[:, 0], run.goal[:, 0], strict=True)
    ]  # fmt: skip
    log = tmp_path / "record.json"
    log.write_text(json.dumps({"mass": 0.5, "kp": 32, "motor": "sts3215", "entries": entries}))
    done = imported(one, [log])
    assert np.allclose(done.goal[:, 0], run.goal[:, 0])
    assert "load is a servo's load in no known unit" in done.text


def test_goals_and_positions_in_two_files(urdf: Path) -> None:
    run = motion()
    columns = columns_of(run)
    logs = [
        write(urdf.parent / f"{kind}.parquet", {x: y for x, y in columns.items() if x == "time" or kind in x})
        for kind in ("present_position", "goal_position")
    ]
    assert np.array_equal(imported(urdf, logs).goal, run.goal[:, :3])


def changed(columns: Columns, **values: np.ndarray | None) -> Columns:
    """Columns with other goals; None: without."""
    goals = {f"goal_position.{joint}": x for joint, x in values.items()}
    return {name: x for name, x in (columns | goals).items() if x is not None}  # type: ignore[union-attr]


def test_a_joint_without_goals_or_with_a_constant_one_is_left_out(urdf: Path) -> None:
    columns = changed(columns_of(motion()), lift=None, roll=np.full(900, 0.3))
    text = imported(urdf, [write(urdf.parent / "run.parquet", columns)]).text
    assert "lift has present_position.lift and no goal, expected both" in text
    assert "roll: goal_position.roll does not change in any log" in text


def test_a_goal_that_is_constant_in_the_first_logs_is_kept_where_it_moves_later(urdf: Path) -> None:
    still = [changed(columns_of(motion(k)), roll=np.full(900, 0.3)) for k in range(3)]
    logs = [write(urdf.parent / f"run{k}.parquet", x) for k, x in enumerate([*still, columns_of(motion(3))])]
    assert "roll" in imported(urdf, logs).joints


def test_goals_that_are_missing_in_rows_hold(urdf: Path) -> None:
    run = motion()
    sparse = run.goal[:, 0].copy()
    sparse[np.arange(900) % 3 > 0] = np.nan
    done = imported(urdf, [write(urdf.parent / "run.parquet", changed(columns_of(run), pan=sparse))])
    assert np.array_equal(done.goal[:, 0], np.repeat(run.goal[::3, 0], 3))
    assert any("600 rows lack a goal" in note for note in done.notes)


@pytest.mark.parametrize("kind", ["degrees", "zero", "counts", "sign"])
def test_a_goal_in_another_unit_than_the_position(kind: str, urdf: Path) -> None:
    run = motion()
    columns = columns_of(run)
    log = write(urdf.parent / "run.parquet", columns)
    mapping = mapping_of(urdf, [log])  # of the right log
    goal = run.goal[:, 0]
    wrong = {
        "degrees": np.degrees(goal),
        "zero": goal + np.pi,
        "counts": np.round(goal / COUNT) + 2048,
        "sign": -goal,
    }[kind]
    write(log, changed(columns, pan=wrong))
    with pytest.raises(InputError) as refused:
        import_logs(mapping, None)
    message = str(refused.value)
    key = {
        "degrees": 'unit = "deg"',
        "zero": "offset = -3.14",
        "counts": "unit = 0.00153398",
        "sign": "sign = -1",
    }[kind]
    for said in ("run.parquet", "column goal_position.pan", "expected", key, "theta_ref of [joints.pan]"):
        assert said in message
    near = 0.01 if kind == "zero" else 3 * COUNT
    done = import_logs(mapping, None, mend=True)
    assert np.abs(done.groups[0].table.theta_ref[:, 0] - goal).max() < near  # type: ignore[index]
    assert np.abs(imported(urdf, [log]).goal[:, 0] - goal).max() < near  # the draft states the key itself


@pytest.mark.parametrize(
    "goal, said",
    [
        (np.full(900, 0.3), "found 0.3000 throughout, expected goals that change"),
        (np.full(900, np.nan), "of run.parquet cannot be used: it has no values"),
        (2.5 + np.sin(np.arange(900.0)), "does not move with it, expected the goal of pan"),
    ],
)
def test_goals_that_are_none(goal: np.ndarray, said: str, urdf: Path) -> None:
    columns = columns_of(motion())
    log = write(urdf.parent / "run.parquet", columns)
    mapping = mapping_of(urdf, [log])
    write(log, changed(columns, pan=goal))
    with pytest.raises(InputError) as refused:
        import_logs(mapping, None)
    assert said in str(refused.value) and "goal_position.pan" in str(refused.value)


def test_the_drive_of_a_mapping_is_that_of_the_set(urdf: Path) -> None:
    mapping = mapping_of(urdf, [write(urdf.parent / "run.parquet", columns_of(motion()))])
    text = mapping.read_text(encoding="utf-8").replace(
        '"goal"\n', '"goal"\nkp = 12.0\nsame = [["pan", "roll"]]\n'
    )
    mapping.write_text(text.replace('group = "run"', 'group = "run"\nkp_scale = 0.5'), encoding="utf-8")
    import_logs(mapping, urdf.parent / "set")
    found = read_set(urdf.parent / "set")
    assert (
        found.drive is not None and found.drive.kp == (12.0,) * 3 and found.drive.same == (("pan", "roll"),)
    )
    assert found.groups[0].kp_scale == 0.5
    mapping.write_text(text.replace('"roll"]]', '"rol"]]'), encoding="utf-8")
    with pytest.raises(InputError, match=r'drive\.same.*"rol" is not in the set'):
        read_mapping(mapping)


@pytest.mark.skipif(not (REAL / "so101").is_dir(), reason="recordings are not here")
def test_the_draft_of_so101_needs_no_edit(tmp_path: Path) -> None:
    robot = tmp_path / "so101.urdf"
    robot.write_bytes((REAL / "so101" / "so101.urdf").read_bytes())
    done = imported(robot, sorted((REAL / "so101").glob("*.parquet")))
    assert done.joints == ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
    assert "present_current.# is a current without a sign" in done.text
    assert (
        '# same = [["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]]' in done.text
    )


def test_a_form_asks_for_goals_and_not_for_torques(urdf: Path) -> None:
    columns = columns_of(motion())
    draft = inspect_logs([write(urdf.parent / "run.parquet", columns)], str(urdf)).draft
    assert gaps(draft) == []
    del draft.joints["lift"].signals["theta_ref"]
    assert gaps(draft) == ["the column of the goal of θ of lift"]
    mapping = urdf.parent / "mapping.toml"
    mapping.write_text(edited(draft).text(mapping), encoding="utf-8")
    with pytest.raises(InputError, match=r"joints\.lift\.theta_ref: is missing, .*θ and its goal"):
        read_mapping(mapping)
