"""Logs in controllers' own forms are recognised, and lead to the parameters of the robot that made them."""

from __future__ import annotations

import gzip
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from independent.arms import urdf_text
from independent.cases import draw

from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.content.wording import issue_text
from flexviz.data.importing import Inspection, Questions, import_logs, importing, inspect_logs
from flexviz.data.importing.ready_mappings import FOLDER, ready_mappings, recognised
from flexviz.data.logs.columns import candidates, find_families
from flexviz.data.logs.formats import find_logs, open_log
from flexviz.data.logs.formats.base import Log, LogTable, ReadOptions
from flexviz.data.logs.mapping import parse
from flexviz.data.measurements import MeasurementSet, read_set
from tests import controller_logs as logs
from tests.cases import with_slow
from tests.controller_logs import CONSTANTS, GEARS, RATED, Run

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "importing.md"
ROWS = 6000


@pytest.fixture(autouse=True)
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    """The delay of the torque is not what is tested here, and takes long."""
    monkeypatch.setattr(importing, "torque_delay", lambda *_: None)


@pytest.fixture(scope="module")
def made() -> SimpleNamespace:
    """A flexible arm with known parameters, its runs and its payloads."""
    case = draw(7, "none", "2r", noise=1.0, hold=0.0, duration=ROWS / 1000)
    record = case.record
    signals = record.theta, record.tau, record.q, record.reference, record.joint_torque
    runs = [Run(record.time, *(x[i] for x in signals)) for i in range(len(record.theta))]
    link = case.setup.arm.links[-1].name
    bodies = {
        name: {
            "bodies": [
                {"link": link, "mass": b.mass, "com": [*b.com], "inertia": [*b.inertia]} for b in carried
            ]
        }
        for name, carried in zip(case.setup.payload_names, case.setup.payloads, strict=True)
    }
    return SimpleNamespace(case=case, runs=runs, payloads=bodies, names=case.setup.payload_names)


class Answers(Questions):
    """Gears and torque constants, as their owner knows them."""

    def numbers(self, question: str, count: int, signed: bool = False) -> Sequence[float] | None:
        return CONSTANTS if "torque constant" in question.lower() else GEARS if "gear" in question else None


Write = Callable[[Path, Run], Path]
MOTOR_SIDE: dict[str, Write] = {
    "Universal Robots RTDE recording": logs.rtde,
    "Universal Robots RTDE recording, torque": logs.rtde_torque,
    "KUKA RSI": logs.rsi,
    "ABB EGM": logs.egm_json,
    "ABB EGM, logger": logs.egm_logger,
    "Beckhoff TwinCAT Scope": logs.twincat,
    "Unitree LowState": logs.unitree,
    "Unitree LowState, bag": logs.unitree_bag,
    "Dynamixel X servos": logs.dynamixel,
    "Feetech STS servos": logs.feetech,
}
SENSOR: dict[str, Write] = {
    "Franka (libfranka log or franka_msgs)": logs.libfranka,
    "Franka (libfranka log or franka_msgs), bag": logs.franka_bag,
    "Kinova Kortex feedback": logs.kinova,
}


def inspected(
    made: SimpleNamespace, folder: Path, write: Write, runs: Sequence[int] = (0, 1, 2, 3)
) -> Inspection:
    """The logs of some runs are written and inspected."""
    (folder / "robot.urdf").write_text(urdf_text(made.case.drawn))
    files = []
    for i in runs:
        place = folder / f"run{i}"
        place.mkdir()
        files.append(write(place, made.runs[i]))
    return inspect_logs(files, str(folder / "robot.urdf"), questions=Answers())


def imported(
    made: SimpleNamespace, folder: Path, found: Inspection, runs: Sequence[int] = (0, 1, 2, 3)
) -> MeasurementSet:
    """The set that the draft leads to, with the payloads filled in."""
    document = found.draft.document(folder)
    document["payloads"] = made.payloads
    for entry, i in zip(document["logs"], runs, strict=True):
        entry |= {"payload": made.names[i], "validation": i == 3}
    file = folder / "mapping.toml"
    done = import_logs(file, folder / "set", mapping=parse(document, file))
    assert done.folder is not None, [issue_text(issue) for issue in done.issues]
    return read_set(done.folder)


LONG = "KUKA RSI", "ABB EGM", "Unitree LowState, bag", "Unitree LowState"


@pytest.mark.parametrize("title", with_slow(MOTOR_SIDE, LONG))
def test_parameters_within_their_intervals(title: str, made: SimpleNamespace, tmp_path: Path) -> None:
    found = inspected(made, tmp_path, MOTOR_SIDE[title])
    assert f"  recognised: {title.split(',')[0]}" in found.draft.seen
    if title.startswith("Beckhoff"):  # what no log tells
        assert [line.split(":")[0] for line in found.draft.missing] == ["unit of tau [Nm]"]
        for joint, rated in zip(found.draft.joints.values(), RATED, strict=True):
            joint.signals["tau"]["unit"] = rated / 1000
        found.draft.missing.clear()
    assert not found.draft.missing and not [issue for issue in found.issues if issue.severity == "wrong"]
    result = identify(imported(made, tmp_path, found))
    assert result.converged
    truth = made.case.truth
    checked = 0
    for j, joint in enumerate(truth["joints"]):
        known = {name: truth[name][j] for name in ("stiffness", "motor_inertia")} | truth["inertial"][joint]
        known["viscous_friction_sum"] = truth["viscous_link"][j] + truth["viscous_motor"][j]
        for found_value in (p for p in result.parameters if p.joint == joint and p.name in known):
            if found_value.identifiable == "yes":
                checked += 1
                error = abs(found_value.value - known[found_value.name])
                assert error < 3.5 * found_value.std + 1e-3 * abs(known[found_value.name]), found_value
    assert checked >= 6


@pytest.mark.parametrize("title", SENSOR)
def test_sides_of_the_spring(title: str, made: SimpleNamespace, tmp_path: Path) -> None:
    """Joint torque sensors and link positions go to their places, and what the torque is, is said."""
    found = inspected(made, tmp_path, SENSOR[title], (0,))
    assert f"  recognised: {title.split(',')[0]}" in found.draft.seen
    assert any("without motor inertia" in line for line in found.draft.seen)
    assert not found.draft.missing, found.draft.missing
    (group,) = imported(made, tmp_path, found, (0,)).groups
    (segment,), run = group.segments, made.runs[0]
    np.testing.assert_allclose(segment.tau, run.joint_torque, atol=1e-6)
    np.testing.assert_allclose(segment.theta, run.q if title.endswith("msgs)") else run.theta, atol=1e-6)
    if title.endswith("bag"):
        assert group.q is not None
        np.testing.assert_allclose(group.q, run.q, atol=1e-9)


def test_reference_and_dynamic_states_of_ros2_control(made: SimpleNamespace, tmp_path: Path) -> None:
    found = inspected(made, tmp_path, logs.ros2_control_bag, (0,))
    assert not found.draft.missing
    joint = found.draft.joints["joint2"].signals
    assert joint["theta"]["from"] == "/dynamic_joint_states/joint2/position"
    assert joint["theta_ref"]["from"] == "/arm_controller/controller_state/reference/joint2/position"
    (group,) = imported(made, tmp_path, found, (0,)).groups
    np.testing.assert_allclose(group.segments[0].tau, made.runs[0].tau, atol=1e-9)
    assert group.theta_ref is not None
    np.testing.assert_allclose(group.theta_ref, made.runs[0].reference, atol=1e-9)


def test_copies_of_joint_states_are_not_asked_about() -> None:
    """ros2_control publishes every state twice, and the controller's own view of it."""
    topics = "/arm/controller_state/actual", "/dynamic_joint_states", "/joint_states"
    names = [
        f"{topic}/joint{j}/{kind}" for topic in topics for kind in ("position", "effort") for j in (1, 2)
    ]
    families = find_families(names, ("joint1", "joint2"), {})
    for signal in ("theta", "tau"):
        found = candidates(families, signal)
        assert found.clear and found.families[0].name.startswith("/joint_states/")


@pytest.mark.slow
def test_what_effort_is_is_asked_with_what_gravity_says(made: SimpleNamespace, tmp_path: Path) -> None:
    asked: list[str] = []
    constant = 9.0  # [Nm/A] at the joint

    class Current(Answers):
        def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
            asked.append(question)
            return 1 if question.startswith("What is") else default

        def numbers(self, question: str, count: int, signed: bool = False) -> Sequence[float] | None:
            return [constant] * count if "torque constant" in question else None

    def currents(folder: Path, run: Run) -> Path:
        return logs.ros2_control_bag(folder, replace(run, tau=run.tau / constant))

    plain = inspected(made, tmp_path, currents, (0,))
    (said,) = (line for line in plain.draft.seen if "taken for" in line and "effort" in line)
    assert "motor torque at the joint [Nm], with gravity" in said and "with a factor of 0.1" in said
    files = [source.path for source in plain.draft.sources]
    found = inspect_logs(files, str(tmp_path / "robot.urdf"), questions=Current())
    (question,) = (text for text in asked if text.startswith("What is"))
    assert "effort" in question and "the URDF's gravity explains" in question
    for joint in found.draft.joints.values():
        assert joint.signals["tau"]["unit"] == "A" and joint.torque_constant == constant
    np.testing.assert_allclose(
        imported(made, tmp_path, found, (0,)).groups[0].segments[0].tau, made.runs[0].tau, atol=1e-9
    )


@pytest.mark.parametrize("kind", ["xlsx", "zip", "zip of many", "gz", "folder of zips"])
def test_workbooks_and_archives(kind: str, made: SimpleNamespace, tmp_path: Path) -> None:
    columns = {"time": made.runs[0].time[:400], **logs.each("theta_joint{}", made.runs[0].theta[:400], 1)}
    plain = logs.table(tmp_path / "run.csv", columns)
    if kind == "xlsx":
        file = logs.excel(tmp_path / "run.xlsx", columns)
    elif kind == "gz":
        file = tmp_path / "run.csv.gz"
        file.write_bytes(gzip.compress(plain.read_bytes()))
    else:
        file = tmp_path / "zips" / "runs.zip"
        file.parent.mkdir()
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in ("run.csv", "more/run2.csv") if kind == "zip of many" else ("run.csv",):
                archive.write(plain, name)
            archive.writestr("__MACOSX/._run.csv", "x")
            archive.writestr("notes.pdf", "x")
    sources = find_logs([file.parent if kind == "folder of zips" else file])
    assert len(sources) == (2 if kind == "zip of many" else 1)
    for source in sources:
        log = open_log(source.path, ReadOptions())
        assert log.file == source.path
        for name, values in columns.items():
            np.testing.assert_allclose(log.tables[0].columns[name], values, atol=1e-10)
    if kind == "zip of many":
        with pytest.raises(
            InputError, match=r"the archive holds more/run2.csv, run.csv, expected one of them"
        ):
            open_log(file, ReadOptions())


def test_damaged_archives_are_named(tmp_path: Path) -> None:
    for name in ("run.zip", "run.csv.gz", "run.xlsx"):
        (tmp_path / name).write_bytes(b"no archive at all")
        with pytest.raises(InputError, match=f"{name}: not a readable"):
            open_log(tmp_path / name, ReadOptions())


def test_scope_channels_of_different_rates_keep_their_times(made: SimpleNamespace, tmp_path: Path) -> None:
    head = [
        "Name,scope",
        "File,x",
        "Name,a,Name,b",
        "SampleTime[ms],1,SampleTime[ms],2",
        "Unit,deg,Unit,Nm",
        "",
    ]
    rows = [f"{k},{0.1 * k},{2 * k if k < 50 else ''},{0.2 * k if k < 50 else ''}" for k in range(100)]
    (tmp_path / "s.csv").write_text("\n".join([*head, *rows]))
    (table,) = open_log(tmp_path / "s.csv", ReadOptions()).tables
    assert list(table.columns) == ["time of a", "a", "time of b", "b"]
    assert table.units == {"a": "deg", "b": "Nm", "time of a": "ms", "time of b": "ms"}
    assert table.columns["time of b"][49] == 98 and np.isnan(table.columns["b"][50])


def test_a_log_of_nobody_is_of_no_controller(made: SimpleNamespace, tmp_path: Path) -> None:
    def own(folder: Path, run: Run) -> Path:
        return logs.table(
            folder / "a.csv",
            {"time": run.time, **logs.each("pos{}", run.theta), **logs.each("tau{}", run.tau)},
        )

    found = inspected(made, tmp_path, own, (0,))
    assert not any("recognised:" in line for line in found.draft.seen) and not found.draft.missing


NAMES = {  # other names that loggers give the same signals: θ and τ of two joints
    "rtde/actual_q_{0} rtde/actual_current_{0}": "Universal Robots RTDE recording",
    "AIPos_A{1} GearTorque_A{1}": "KUKA RSI",
    "GVL.axes[{1}].NcToPlc.ActPos GVL.axes[{1}].NcToPlc.ActTorque": "Beckhoff TwinCAT Scope",
    "/franka_states/theta[{0}] /franka_states/tau_J[{0}]": "Franka (libfranka log or franka_msgs)",
    "theta[:,{0}] tau_J[:,{0}]": "Franka (libfranka log or franka_msgs)",
    "state.motorState[{0}].q state.motorState[{0}].tauEst": "Unitree LowState",
    "id{1}.Present_Position id{1}.Present_Current": "Dynamixel X servos",
    "present_position[{0}] present_current[{0}]": "Dynamixel X servos",
    "position{0} torque{0}": None,
    "q{1} tau{1}": None,
}


@pytest.mark.parametrize("names", NAMES)
def test_names_of_other_loggers(names: str) -> None:
    columns = {"time": np.arange(40.0)}
    for pattern in names.split():
        columns |= {pattern.format(j, j + 1): 1000 * np.sin(np.arange(40.0) + j) for j in range(2)}
    found = recognised(Log(Path("x"), "CSV", (LogTable("", columns),)), ("joint1", "joint2"))
    assert (found and found.mapping.title) == NAMES[names]
    if found is not None:
        for signal, pattern in zip(("theta", "tau"), names.split(), strict=True):
            expected = {f"joint{j + 1}": pattern.format(j, j + 1) for j in range(2)}
            assert dict(found.roles[signal].columns) == expected


SPEED = np.round(300 * np.sin(np.arange(400.0) / 20))
SENT = np.where(SPEED < 0, 2**15 - SPEED, SPEED)
SENT_LOAD = np.where(SPEED < 0, 2**10 - SPEED, SPEED)
REGISTERS = {  # columns of LeRobot's names, what they are, and the sign bit that is stated of τ
    "raw": ({"present_velocity": SENT, "present_current": SENT}, "Feetech STS servos", 15),
    "raw load": ({"present_velocity": SENT, "present_load": SENT_LOAD}, "Feetech STS servos", 10),
    "decoded": ({"present_velocity": SPEED, "present_load": SPEED, "present_current": SPEED},
                "Feetech STS servos", None),
    "decoded, voltage": ({"present_velocity": SPEED, "present_current": SPEED,
                          "present_voltage": 120 + 0 * SPEED}, "Feetech STS servos", None),
    "Dynamixel X": ({"present_velocity": SPEED, "present_current": SPEED,
                     "present_input_voltage": 120 + 0 * SPEED}, "Dynamixel X servos", None),
    "Dynamixel X, unsigned": ({"present_velocity": SPEED % 2**32, "present_current": SPEED % 2**16},
                              "Dynamixel X servos", None),
    "16 bits in two's complement": ({"present_velocity": SPEED % 2**16, "present_load": SPEED % 2**16},
                                    "Dynamixel X servos", None),
    "AX or MX": ({"present_load": SENT_LOAD}, "Dynamixel X servos", 10),
}  # fmt: skip


@pytest.mark.parametrize("name", REGISTERS)
def test_registers_with_a_sign_bit(name: str) -> None:
    signals, title, bit = REGISTERS[name]
    columns = {"time": np.arange(400.0)}
    for joint in ("joint1", "joint2"):
        columns |= {f"{key}_{joint}": x for key, x in ({"present_position": 2048 + SPEED} | signals).items()}
    found = recognised(Log(Path("x"), "CSV", (LogTable("", columns),)), ("joint1", "joint2"))
    assert found is not None and found.mapping.title == title
    assert found.roles["tau"].stated.get("sign_bit") == bit
    assert (found.roles["theta"].stated.get("sign_bit") == 15) == (title == "Feetech STS servos")


def test_every_ready_mapping_is_tried_and_documented() -> None:
    titles = {mapping.title for mapping in ready_mappings()}
    assert len(titles) == len(list(FOLDER.glob("*.toml")))
    assert titles == {title.split(",")[0] for title in (*MOTOR_SIDE, *SENSOR)}
    text = DOCUMENT.read_text(encoding="utf-8")
    assert not [title for title in titles if title not in text]
