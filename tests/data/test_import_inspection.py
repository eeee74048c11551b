"""Looking at logs: what names say, what data correct, what a person is asked, and a mapping that imports."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest
from import_data import JOINTS, link_messages, motor_messages, truth, write_lerobot, write_mcap, write_robot

from flexviz.base.errors import InputError
from flexviz.content.wording import issue_text
from flexviz.data.importing import Inspection, import_logs, inspect_logs
from flexviz.data.importing.draft import Person
from flexviz.data.importing.torque_meaning import evidence
from flexviz.data.logs.clocks import guess_unit
from flexviz.data.logs.column_names import unit_in
from flexviz.data.logs.columns import candidates, find_families
from flexviz.data.logs.formats import open_log
from flexviz.data.logs.formats.base import Log, LogTable, ReadOptions
from flexviz.robot.robot import Robot
from tests.small_set import URDF

DATA = truth(rows=1500)
UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
PANDA = tuple(f"panda_joint{i}" for i in range(1, 8))
TWO = ("joint1", "joint2")


@pytest.fixture(autouse=True)
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)


def names(pattern: str, numbers: Sequence[Any]) -> list[str]:
    return [pattern.replace("#", str(number)) for number in numbers]


CORPUS: list[tuple[tuple[str, ...], list[str], dict[str, str]]] = [
    # joints; columns with # for the joints' numbers or names; which family is taken for what
    (TWO, ["theta_#", "tau_#", "q_#", "tau_joint_#", "theta_ref_#"], {}),
    (TWO, ["/motor_states/#/position", "/motor_states/#/effort", "/motor_states/#/velocity",
           "/joint_states/#/position"],
     {"theta": "/motor_states/#/position", "tau": "/motor_states/#/effort", "q": "/joint_states/#/position"}),
    (UR, ["actual_q_%", "actual_qd_%", "actual_current_%", "target_q_%", "target_qdd_%",
          "joint_temperatures_%"],
     {"theta": "actual_q_%", "tau": "actual_current_%", "theta_ref": "target_q_%"}),
    (PANDA, ["q[%]", "dq[%]", "tau_J[%]", "tau_J_d[%]", "q_d[%]", "tau_ext_hat_filtered[%]"],
     {"theta": "q[%]", "tau": "tau_J[%]", "theta_ref": "q_d[%]", "tau_joint": "tau_ext_hat_filtered[%]"}),
    (UR, ["observation.state/#.pos", "action/#.pos", "observation.effort/#.effort"],
     {"theta": "observation.state/#.pos", "tau": "observation.effort/#.effort", "theta_ref": "action/#.pos"}),
    (TWO, ["Position Joint % [deg]", "Drehmoment Joint % [Nm]", "Strom Joint % [A]", "Temp %"],
     {"theta": "Position Joint % [deg]", "tau": "Drehmoment Joint % [Nm]"}),
    (TWO, ["qm%", "ql%", "dqm%", "u%"], {"theta": "qm%", "q": "ql%", "tau": "u%"}),
    (TWO, ["can0_motor%_pos", "can0_motor%_cur"], {"theta": "can0_motor%_pos", "tau": "can0_motor%_cur"}),
    (TWO, ["log.motor.q(:,%)", "log.link.q(:,%)", "log.tau(:,%)"],
     {"theta": "log.motor.q(:,%)", "q": "log.link.q(:,%)", "tau": "log.tau(:,%)"}),
    (TWO, ["tau_g_all(:,%)", "act_torque_abs_nm(:,%)", "act_pos_rad(:,%)"],
     {"theta": "act_pos_rad(:,%)", "tau": "act_torque_abs_nm(:,%)"}),
    (TWO, ["torque%", "torque_act%", "q_meas%"], {"theta": "q_meas%", "tau": "torque_act%"}),
]  # fmt: skip


@pytest.mark.parametrize("case", range(len(CORPUS)))
def test_names(case: int) -> None:
    """Columns as robots really call them, by the joints' names or by numbers, become the right signals."""
    joints, patterns, expected = CORPUS[case]
    expected = expected or {pattern.removesuffix("_#"): pattern for pattern in patterns}
    first = 0 if any(p.startswith(("actual", "q[")) for p in patterns) else 1
    columns = {
        pattern: names(pattern, joints) if "#" in pattern else
        [pattern.replace("%", str(i)) for i in range(first, first + len(joints))]
        for pattern in patterns
    }  # fmt: skip
    if case == 4:  # without the word that all joints share
        columns = {p: [c.replace("_joint", "") for c in found] for p, found in columns.items()}
    families = find_families([c for found in columns.values() for c in found], joints, {})
    taken: list[Any] = []
    for name in ("theta", "tau", "q", "tau_joint", "theta_ref"):
        found = candidates(families, name, taken)
        if name not in expected:
            continue
        assert found.families, (name, [f.name for f in families])
        best = found.families[0]
        assert dict(best.columns) == dict(zip(joints, columns[expected[name]], strict=True)), name
        taken.append(best)


def test_numbers_are_the_joints_own_where_they_have_some() -> None:
    joints = ("joint1", "joint2", "joint3")
    (family,) = find_families(["pos2", "pos3"], joints, {})
    assert dict(family.columns) == {"joint2": "pos2", "joint3": "pos3"} and family.found_by == "number"
    (family,) = find_families(["pos0", "pos1", "pos2"], joints, {})
    assert dict(family.columns) == {"joint1": "pos0", "joint2": "pos1", "joint3": "pos2"}
    (family,) = find_families(["pos_2"], joints, {})
    assert dict(family.columns) == {"joint2": "pos_2"}
    assert find_families(["pos_1", "pos_3"], ("a", "b", "c"), {}) == []


def test_unknown_names_in_order() -> None:
    """As many unknown joints in a bag as the robot has: taken in order, and said to be so."""
    (family,) = find_families(["/js/left/position", "/js/right/position"], TWO, {})
    assert dict(family.columns) == {"joint1": "/js/left/position", "joint2": "/js/right/position"}
    assert family.found_by == "order"
    assert find_families(["/js/a/position", "/js/b/position", "/js/c/position"], TWO, {}) == []


def test_units_in_names() -> None:
    said = {
        "q_deg(:,1)": "deg",
        "tau_nm[0]": "Nm",
        "q(:,1)": None,
        "q1_deg": "deg",
        "I1 [A]": "A",
        "t (ms)": "ms",
        "tau[N·m]": "Nm",
        "position_a": None,
        "q": None,
    }
    assert {name: unit_in(name) for name in said} == said
    for values, unit in (
        (0.004 * np.arange(99), "s"),
        (np.arange(99), "ms"),
        (500 * np.arange(99), "us"),
        (2_000_000 * np.arange(99), "ns"),
    ):
        assert guess_unit(LogTable("", {"t": values}), "t")[0] == unit


def csv_of(folder: Path, columns: dict[str, np.ndarray], name: str = "run.csv") -> Path:
    write_robot(folder)
    pacsv.write_csv(pa.table(columns), folder / name)
    return folder / name


def written(folder: Path, inspection: Inspection) -> Path:
    """The mapping file that was found."""
    file = folder / "found.toml"
    file.write_text(inspection.draft.text(file))
    return file


def same(folder: Path, mapping: Path) -> None:
    """A mapping imports to the truth."""
    done = import_logs(mapping, folder / "set")
    assert done.folder is not None, [issue_text(s) for s in done.issues]
    table = done.groups[0].table
    assert np.abs(table.theta - DATA.theta).max() < 1e-9 and np.abs(table.tau - DATA.tau).max() < 1e-9


def test_csv_in_degrees_with_a_joint_turned_round(tmp_path: Path) -> None:
    """Units by name where they stand there, else by the robot's masses, as are the signs."""
    turned = np.array([1.0, -1.0])
    columns = {"Time [ms]": DATA.time * 1e3, "mode": np.ones(1500)}
    for j in range(2):
        columns |= {
            f"pos_{j + 1}": np.rad2deg(DATA.theta[:, j]),
            f"torque_{j + 1}": DATA.tau[:, j] * turned[j],
        }
    log = csv_of(tmp_path, columns)
    inspection = inspect_logs([log], str(tmp_path / "robot.urdf"))
    assert inspection.draft.time == {"column": "Time [ms]", "unit": "ms"} and not inspection.issues
    text = written(tmp_path, inspection).read_text()
    assert 'theta = {from = "pos_1", unit = "deg"}\n' in text
    low, high = np.rad2deg(DATA.theta[:, 0].min()), np.rad2deg(DATA.theta[:, 0].max())
    seen = f"# theta: {low:.4g} … {high:.4g}; position, joints by number"
    assert seen in text
    assert 'tau = {from = "torque_2", sign = -1}' in text
    assert 'robot = "robot.urdf"' in text and "step 0.002 s; the unit is stated" in text
    assert re.search(r'with unit = "deg" the robot.s masses explain \d+ %', text)
    same(tmp_path, tmp_path / "found.toml")


def test_a_computed_torque_is_not_taken_and_a_choice_is_told(tmp_path: Path) -> None:
    """A gravity torque of the opposite sign is no measured one, even alone; equal names are listed."""
    base = {"t": DATA.time}
    for j in range(2):
        base |= {f"tau_g_all{j + 1}": -DATA.tau[:, j], f"pos{j + 1}": DATA.theta[:, j]}
    robot = str(tmp_path / "robot.urdf")
    alone = inspect_logs([csv_of(tmp_path, base)], robot)
    assert "no columns were recognised as the motor torque" in alone.draft.missing[0]
    for j in range(2):
        base |= {f"torque_a{j + 1}": DATA.tau[:, j], f"torque_b{j + 1}": DATA.tau[:, j] + 1.0}
    text = inspect_logs([csv_of(tmp_path, base)], robot).draft.text(None)
    assert "taken for the motor torque τ (or the current): torque_a#; others: torque_b#" in text
    assert "sign" not in text.split("[joints.joint1]")[1]


def test_bag_with_two_topics(tmp_path: Path) -> None:
    """Gear, side, the link clock's offset: all from the data, and every reason is written beside it."""
    write_robot(tmp_path)
    gear = np.array([100.0, 80.0])
    messages = motor_messages(DATA, gear=gear) + link_messages(DATA, late=0.02)
    write_mcap(tmp_path / "run.mcap", messages)
    inspection = inspect_logs([tmp_path / "run.mcap"], str(tmp_path / "robot.urdf"))
    assert [joint.gear for joint in inspection.draft.joints.values()] == pytest.approx(
        [100.0, 80.0], rel=2e-3
    )
    assert inspection.draft.time["shift"]["/joint_states"] == pytest.approx(-0.02, abs=1e-4)
    text = written(tmp_path, inspection).read_text()
    assert '"/motor_states/joint1/effort", side = "motor"' in text and "times as far as q" in text
    assert "/joint_states is 20 ±" in text and "ms late against θ" in text
    (tmp_path / "found.toml").write_text(
        re.sub(r"gear = (99|100)\.\d+", "gear = 100.0", text)
    )  # the data sheet
    same(tmp_path, tmp_path / "found.toml")


def test_what_a_lerobot_dataset_says_of_its_folders_is_not_trusted(tmp_path: Path) -> None:
    write_lerobot(tmp_path / "data", [DATA], "v2.1", None)
    file = tmp_path / "data" / "meta" / "info.json"
    about = json.loads(file.read_text()) | {"chunks_size": "x", "data_path": "../../{episode_chunk}.parquet"}
    file.write_text(json.dumps(about))
    log = open_log(tmp_path / "data", ReadOptions(episode=0))
    name = "observation.state[0]"
    assert np.array_equal(log.columns[name].columns[name], DATA.theta[:, 0])


def test_datasets_and_several_logs(tmp_path: Path) -> None:
    write_robot(tmp_path)
    write_lerobot(tmp_path / "data", [DATA, DATA], "v3.0", ["joint1.pos", "joint2.pos"])
    inspection = inspect_logs([tmp_path / "data"], str(tmp_path / "robot.urdf"))
    assert inspection.draft.groups == ["episode0", "episode1"] and not inspection.draft.time
    same(tmp_path, written(tmp_path, inspection))


@pytest.mark.parametrize("runs", [1, 2])
def test_position_and_current_in_two_files_are_one_run(tmp_path: Path, runs: int) -> None:
    """With clocks of their own; kinds of files are told apart by their columns, runs are in order."""
    logs = []
    for run in range(1, runs + 1):
        late = DATA.time[::2] + 0.0007  # the currents' clock
        torque = np.stack([np.interp(late, DATA.time, x) for x in DATA.tau.T])
        position = {"t": DATA.time} | {f"q{j + 1}": DATA.theta[:, j] for j in range(2)}
        current = {"t": late} | {f"torque_{j + 1}": torque[j] for j in range(2)}
        logs += [csv_of(tmp_path, position, f"pos_run{run}.csv"), csv_of(tmp_path, current, f"cur{run}.csv")]
    inspection = inspect_logs(logs, str(tmp_path / "robot.urdf"))
    assert not inspection.draft.missing and len(inspection.draft.groups) == runs
    text = written(tmp_path, inspection).read_text()
    assert 'file = ["pos_run1.csv", "cur1.csv"]' in text and 'time = "b/t"' in text
    done = import_logs(tmp_path / "found.toml", tmp_path / "set")
    group = done.groups[-1]
    assert (
        len(done.groups) == runs
        and done.folder is not None
        and done.to_json()["groups"][0]["log"] == "pos_run1.csv, cur1.csv"
    )
    rows = np.searchsorted(DATA.time, group.table.time + group.zero)
    assert np.abs(group.table.theta - DATA.theta[rows]).max() < 1e-9
    assert np.abs(group.table.tau - DATA.tau[rows]).max() < 0.02  # noise is interpolated


class Typing:
    """Answers for questions, in order; keeps what was asked."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.asked, self.told = list(answers), [], []

    def ask(self, question: str, default: str) -> str:
        self.asked.append(question)
        answer = self.answers.pop(0)
        return answer or default

    def tell(self, line: str) -> None:
        self.told.append(line)


def test_questions(tmp_path: Path) -> None:
    """What neither names nor data know is asked; an answer that makes no sense is asked again."""
    constant = np.array([0.1, 0.2])
    columns = {"t": DATA.time}
    for j in range(2):
        columns |= {f"ch{j + 1}": DATA.theta[:, j], f"i{j + 1}": DATA.tau[:, j] / constant[j] / 50.0}
    for name in ("a.csv", "b.csv"):
        csv_of(tmp_path, columns, name)
    logs = [tmp_path / "a.csv", tmp_path / "b.csv"]
    typing = Typing("x", "7", "1", "0.1,-1", "0.1, 0.2", "50", "3", "2")
    inspection = inspect_logs(logs, str(tmp_path / "robot.urdf"), questions=Person(typing.ask, typing.tell))
    assert not typing.answers and len(typing.asked) == 8
    assert (
        '"x" is none of 0 … 2' in typing.told and '"3" holds something that is none of 1 … 2' in typing.told
    )
    assert any("Which columns are the motor position θ?" in line for line in typing.told)
    assert inspection.draft.validation == {"b"} and not inspection.draft.missing and not inspection.issues
    text = written(tmp_path, inspection).read_text()
    assert "gear = 50.0" in text and "torque_constant = 0.2" in text and 'unit = "A", side = "motor"' in text
    same(tmp_path, tmp_path / "found.toml")


def test_what_is_missing_is_written_down(tmp_path: Path) -> None:
    """Nobody to ask: a torque constant is never guessed, and columns that nothing is known of are offered."""
    columns = {"t": DATA.time}
    for j in range(2):
        columns |= {f"pos{j + 1}": DATA.theta[:, j], f"current{j + 1}": DATA.tau[:, j] / 7.0}
    inspection = inspect_logs([csv_of(tmp_path, columns)], str(tmp_path / "robot.urdf"))
    assert inspection.draft.missing == [
        "torque_constant [Nm/A] of every joint: τ is a current (motor's data sheet)"
    ]
    file = written(tmp_path, inspection)
    with pytest.raises(InputError, match=r"joints\.joint1: tau is a current, expected torque_constant"):
        import_logs(file, None)
    text = file.read_text().replace("# torque_constant = …", "torque_constant = 7.0")
    file.write_text(text)
    same(tmp_path, file)
    nameless = {
        "t": DATA.time,
        "pos1": DATA.theta[:, 0],
        "pos2": DATA.theta[:, 1],
        "x1": DATA.time**2,
        "x2": DATA.time**3,
    }
    inspection = inspect_logs([csv_of(tmp_path, nameless, "other.csv")], str(tmp_path / "robot.urdf"))
    assert "no columns were recognised as the motor torque τ" in inspection.draft.missing[0]
    assert 'missing: { from = "column" }; unit = "A" and torque_constant' in inspection.draft.text(None)
    timeless = {name: np.tile(values, 2) for name, values in columns.items() if name != "t"}
    inspection = inspect_logs([csv_of(tmp_path, timeless, "timeless.csv")], str(tmp_path / "robot.urdf"))
    assert any("step = seconds from row to row" in line for line in inspection.draft.missing)


def test_columns_with_names_of_no_meaning_are_listed_to_be_filled_in(tmp_path: Path) -> None:
    names = {"stamp": DATA.time}
    for j, letter in enumerate("ab"):
        names |= {f"{letter}_one": DATA.theta[:, j], f"{letter}_two": DATA.tau[:, j]}
    inspection = inspect_logs([csv_of(tmp_path, names)], str(tmp_path / "robot.urdf"))
    file = written(tmp_path, inspection)
    text = file.read_text()
    low, high = DATA.tau[:, 1].min(), DATA.tau[:, 1].max()
    assert f"b_two: {low:.4g} … {high:.4g}" in text and 'column = "stamp"' in text
    for letter in "ab":
        text = text.replace("# theta = …", f'theta = "{letter}_one"', 1)
        text = text.replace("# tau = …", f'tau = "{letter}_two"', 1)
    file.write_text(text)
    same(tmp_path, file)


def test_a_time_in_another_unit_is_named_in_the_mapping(tmp_path: Path) -> None:
    columns = {"t": 1e3 * DATA.time}
    for j in range(2):
        columns |= {f"pos{j + 1}": DATA.theta[:, j], f"torque{j + 1}": DATA.tau[:, j]}
    file = written(tmp_path, inspect_logs([csv_of(tmp_path, columns)], str(tmp_path / "robot.urdf")))
    text = file.read_text()
    assert 'unit = "ms"' in text
    file.write_text(text.replace('unit = "ms"', 'unit = "s"', 1))
    with pytest.raises(InputError, match=r'found\.toml, time\.unit: .* is 2: .* expected unit = "ms"'):
        import_logs(file, None)


def test_a_robot_that_does_not_fit(tmp_path: Path) -> None:
    log = csv_of(tmp_path, {"t": DATA.time, "p1": DATA.theta[:, 0], "m1": DATA.tau[:, 0]})
    with pytest.raises(InputError, match="robot description not found"):
        inspect_logs([log], str(tmp_path / "none.urdf"))
    inspection = inspect_logs([log], "example-robot-data:panda")
    assert inspection.draft.missing or set(inspection.draft.joints) == {"panda_joint1"}
    assert JOINTS == TWO


@pytest.mark.parametrize(("scale", "scatter"), [(1.0, 0.0), (-0.4, 0.5), (0.05, 0.8)])
def test_what_gravity_explains_of_an_effort(scale: float, scatter: float, tmp_path: Path) -> None:
    """Of an arm's first joint, (.25 cos q₁ + .5 cos q₁ + .25 cos(q₁ + q₂)) 4 kg g, of a log of 1200 rows."""
    file = tmp_path / "robot.urdf"
    file.write_text(URDF)
    rng = np.random.default_rng(0)
    q = rng.uniform(-2, 2, (1200, 2))
    gravity = 4 * 9.81 * (0.75 * np.cos(q[:, 0]) + 0.25 * np.cos(q.sum(axis=1)))
    left = np.tile([1.0, -1.0], 600)[rng.permutation(1200)]
    tau = scale * (gravity + np.sqrt(scatter / (1 - scatter)) * gravity.std() * left) + 3.0
    columns = {"pos1": q[:, 0], "pos2": q[:, 1], "effort1": tau, "effort2": 0.01 * tau}
    theta, effort = find_families(list(columns), TWO, {})
    said = evidence(
        {"theta": theta, "tau": effort}, Robot.load(file), Log(tmp_path, "CSV", (LogTable("", columns),))
    )
    found = re.fullmatch(
        r"\|joint1\| is up to (\S+), of which the URDF's gravity explains (\d+) % with a factor of (\S+)",
        said,
    )
    assert found is not None, said
    largest, share, factor = map(float, found.groups())
    assert largest == pytest.approx(np.abs(tau).max(), rel=0.1)  # of the rows that are looked at
    assert share == pytest.approx(100 * (1 - scatter), abs=8 if scatter else 0)
    assert factor == pytest.approx(scale, rel=0.15 if scatter else 0.01)
