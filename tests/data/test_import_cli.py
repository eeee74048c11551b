"""`flexviz import` as a user meets it, and an MCAP bag with the same identification as the direct set."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest
from import_data import JOINTS, link_messages, motor_messages, truth, write_mapping, write_mcap, write_robot

import flexviz.data.importing.importing as importing
from flexviz.analysis.identification import Identification, identify
from flexviz.base.errors import Cancelled
from flexviz.base.resources import sessions_dir
from flexviz.data.importing import import_logs
from flexviz.data.measurements import GroupTable, read_set, write_set
from flexviz.outlets.terminal import main

DATA = truth(rows=1000)


# -- the same identification ---------------------------------------------------------------------------


def shortened_groups(rows: int = 4000) -> list[tuple[GroupTable, SimpleNamespace]]:
    """Groups of the bundled set, shortened: as a table, and as what a bag is written from."""
    found = []
    for group in read_set(sessions_dir() / "planar-2r-demo").groups[:3]:
        table = GroupTable.of(group)
        assert table.q is not None
        part = SimpleNamespace(
            time=table.time[:rows], theta=table.theta[:rows], tau=table.tau[:rows], q=table.q[:rows]
        )
        table = replace(
            table, q=None, tau_joint=None, theta_ref=None, time=part.time, theta=part.theta, tau=part.tau
        )
        found.append((replace(table, validation=group.name == "t3p3"), part))
    return found


def parameters(result: Identification) -> np.ndarray:
    return np.array([[p.value, p.std or 0.0] for p in result.parameters])


@pytest.mark.slow
def test_mcap_leads_to_the_same_identification(tmp_path: Path) -> None:
    """Motor and link topics of an MCAP bag, at 1000 and 250 Hz, clocks 20 ms apart, in the motor's units.

    The direct set has θ and τ only: that the results agree also says that link positions are never used.
    """
    source = read_set(sessions_dir() / "planar-2r-demo")
    start = {"torque_hold": source.torque_hold, "initial_stiffness": source.initial_stiffness}
    start["initial_motor_inertia"] = source.initial_motor_inertia
    groups = shortened_groups()
    direct = write_set(
        tmp_path / "direct",
        robot="robots:planar_2r",
        joints=JOINTS,
        groups=[table for table, _ in groups],
        payloads=source.payloads,
        **start,  # type: ignore[arg-type]
    )
    gear, constant, sign = np.array([101.0, 80.0]), np.array([0.12, 0.1]), np.array([1.0, -1.0])
    for table, part in groups:
        motor = motor_messages(part, gear=gear, constant=constant, sign=sign)
        part.q = part.q * 180 / np.pi
        write_mcap(tmp_path / f"{table.name}.mcap", motor + link_messages(part, late=0.02))
    lines = ['robot = "robots:planar_2r"', f"torque_hold = {source.torque_hold}", "[initial]"]
    for name in ("stiffness", "motor_inertia"):
        lines.append(f"{name} = {start[f'initial_{name}'].tolist()}")  # type: ignore[union-attr]
    for name, bodies in source.payloads.items():
        inside = ", ".join(
            f'{{ link = "{b.link}", mass = {b.mass}, com = {b.com.tolist()}, '
            f"inertia = {b.inertia.tolist()} }}"
            for b in bodies
        )
        lines += [f"[payloads.{name}]", f"bodies = [{inside}]"]
    for table, _ in groups:
        lines += ["[[logs]]", f'file = "{table.name}.mcap"', f'group = "{table.name}"']
        lines += [f'payload = "{table.payload}"', f"validation = {str(table.validation).lower()}"]
    for i, joint in enumerate(JOINTS):
        motor = f'"/motor_states/{joint}/{{}}", side = "motor", sign = {int(sign[i])}'
        lines += [f"[joints.{joint}]", f"gear = {gear[i]}", f"torque_constant = {constant[i]}"]
        lines += [f"theta = {{ from = {motor.format('position')} }}"]
        lines += [f'tau = {{ from = {motor.format("effort")}, unit = "A" }}']
        lines += [f'q = {{ from = "/joint_states/{joint}/position", unit = "deg" }}']
    (tmp_path / "mapping.toml").write_text("\n".join(lines))
    report = tmp_path / "report.json"
    arguments = [
        "import",
        str(tmp_path / "mapping.toml"),
        "--out",
        str(tmp_path / "set"),
        "--json",
        str(report),
    ]
    assert main(arguments) == 0
    said = json.loads(report.read_text())
    for offset in said["clock_offsets"]:  # 20 ms, less what motor friction over stiffness looks like
        assert offset["delay"] == pytest.approx(0.0194, abs=5e-4)
    assert abs(said["torque_delay"]["delay"]) < 1e-4
    assert {s["kind"] for s in said["suspicions"]} == {"clock"}
    imported = read_set(tmp_path / "set")
    assert all(group.q is not None for group in imported.groups)
    one, other = identify(read_set(direct)), identify(imported)
    assert one.converged and [p.name for p in one.parameters] == [p.name for p in other.parameters]
    assert parameters(other) == pytest.approx(parameters(one), rel=1e-8, abs=1e-10)
    assert other.residual.rms == pytest.approx(one.residual.rms, rel=1e-8)
    assert other.residual.rms_validation == pytest.approx(one.residual.rms_validation, rel=1e-8)


# -- the command ---------------------------------------------------------------------------------------


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)


def write_log(folder: Path, **changed: np.ndarray) -> Path:
    """A CSV with names that speak for themselves."""
    write_robot(folder)
    columns = {"time": DATA.time}
    for j in range(2):
        columns |= {f"motor_pos_{j + 1}": DATA.theta[:, j], f"motor_torque_{j + 1}": DATA.tau[:, j]}
    pacsv.write_csv(pa.table(columns | changed), folder / "run.csv")
    return folder / "run.csv"


def lines_of(capsys: pytest.CaptureFixture[str]) -> tuple[list[str], list[str]]:
    output = capsys.readouterr()
    return output.out.splitlines(), [line for line in output.err.splitlines() if line.startswith("flexviz: ")]


def test_look_then_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["import", "run.csv", "--robot", "robot.urdf", "--mapping", "arm.toml"]) == 0
    out, errors = lines_of(capsys)
    assert not errors and out[-1] == "arm.toml written: check it, then run flexviz import arm.toml --out SET"
    assert main(["import", "arm.toml", "--out", "set", "--format", "csv", "--json", "report.json"]) == 0
    out, errors = lines_of(capsys)
    assert not errors and out[0].startswith(
        "run: run.csv, CSV, 1000 samples, 1.998 s at 500 Hz, payload none, fit"
    )
    assert out[-1] == f"{tmp_path / 'set'}: 1 groups, joints joint1, joint2"
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["format"] == 1 and report["set"] == str(tmp_path / "set") and not report["suspicions"]
    assert report["groups"][0]["samples"] == 1000 and report["joints"] == list(JOINTS)
    group = read_set("set").groups[0]
    assert group.file.name == "run.csv" and np.abs(group.segments[0].theta - DATA.theta).max() < 1e-12
    # the mapping alone only checks; it is no log, and neither is a set
    assert main(["import", "arm.toml"]) == 0
    assert lines_of(capsys)[0][-1] == "only checked; --out DIR writes the set"
    assert main(["import", "set", "--robot", "robot.urdf"]) == 2
    assert "this is a measurement set already" in lines_of(capsys)[1][0]


def test_gaps_and_the_mean_rate_are_told(
    tmp_path: Path, quick: None, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_log(tmp_path)
    rows = log.read_text().splitlines(keepends=True)
    log.write_text("".join(rows[:400] + rows[500:]))
    main(
        ["import", str(log), "--robot", str(tmp_path / "robot.urdf"), "--out", str(tmp_path / "set"), "--yes"]
    )
    (summary,) = [line for line in lines_of(capsys)[0] if line.startswith("run: ")]
    assert "900 samples, 1.998 s at 500 Hz (449.95 Hz on average) in 2 stretches between gaps" in summary


def test_in_one_step(tmp_path: Path, quick: None, capsys: pytest.CaptureFixture[str]) -> None:
    log = write_log(tmp_path)
    assert (
        main(["import", str(log), "--robot", str(tmp_path / "robot.urdf"), "--out", str(tmp_path / "set")])
        == 0
    )
    assert read_set(tmp_path / "set").joints == JOINTS
    capsys.readouterr()
    assert main(["import", str(log), "--robot", str(tmp_path / "robot.urdf")]) == 0
    printed = capsys.readouterr().out
    assert "[joints.joint1]" in printed and 'from = "motor_torque_2"' in printed  # the mapping itself


def test_refused_unless_insisted(tmp_path: Path, quick: None, capsys: pytest.CaptureFixture[str]) -> None:
    write_log(tmp_path, motor_torque_1=-DATA.tau[:, 0])
    mapping = write_mapping(
        tmp_path, ["run.csv"], '"motor_pos_#"', '"motor_torque_#"', time='column = "time"'
    )
    arguments = ["import", str(mapping), "--out", str(tmp_path / "set"), "--json", str(tmp_path / "r.json")]
    assert main(arguments) == 2
    out, _ = lines_of(capsys)
    assert "looks wrong: tau of joint1: with sign = -1 the robot's masses explain 100 %" in "\n".join(out)
    assert out[-1] == "nothing was written: correct the mapping, or use --yes to write it anyway"
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["set"] is None
    assert report["suspicions"][0]["fixes"] == [
        {"joint": "joint1", "signal": "tau", "key": "sign", "value": -1}
    ]
    assert not (tmp_path / "set").exists()
    assert main([*arguments, "--yes"]) == 0 and (tmp_path / "set" / "measurements.toml").is_file()


def test_incomplete_mapping_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = {"time": DATA.time} | {f"motor_pos_{j + 1}": DATA.theta[:, j] for j in range(2)}
    columns |= {f"current_{j + 1}": DATA.tau[:, j] / 5 for j in range(2)}
    write_robot(tmp_path)
    pacsv.write_csv(pa.table(columns), tmp_path / "run.csv")
    mapping, robot = str(tmp_path / "m.toml"), str(tmp_path / "robot.urdf")
    out = str(tmp_path / "set")
    assert (
        main(["import", str(tmp_path / "run.csv"), "--robot", robot, "--mapping", mapping, "--out", out]) == 1
    )
    lines, _ = lines_of(capsys)
    assert lines[-1].startswith(f"to be filled in in {mapping}: torque_constant [Nm/A] of every joint")
    assert not (tmp_path / "set").exists() and "# MISSING: torque_constant" in Path(mapping).read_text()


USAGE = {
    "no robot": (["run.csv"], "--robot is missing"),
    "robot beside a mapping": (
        ["m.toml", "--robot", "robot.urdf"],
        "--robot applies to logs",
    ),
    "mapping beside a mapping": (["m.toml", "--mapping", "n.toml"], "--mapping applies to logs"),
    "two mappings": (
        ["m.toml", "m.toml", "--robot", "robot.urdf"],
        "a mapping file cannot be combined with logs",
    ),
    "mapping exists": (
        ["run.csv", "--robot", "robot.urdf", "--mapping", "m.toml"],
        r"m\.toml: exists already",
    ),
    "mapping's name": (["run.csv", "--robot", "robot.urdf", "--mapping", "m.txt"], r"ends in \.toml"),
    "set exists": (["m.toml", "--out", "full"], "the folder is not empty"),
    "format": (["m.toml", "--out", "new", "--format", "hdf5"], "--format hdf5: valid: parquet, csv"),
    "no such log": (["none.csv", "--robot", "robot.urdf"], r"none\.csv: file not found"),
    "no such mapping": (["none.toml"], r"none\.toml: cannot be read"),
    "empty folder": (["empty", "--robot", "robot.urdf"], "the folder holds no log"),
    "robot": (["run.csv", "--robot", "robots:nobody"], r'--robot, robot: robots:nobody: .*"robots:nobody"'),
}


@pytest.mark.parametrize("case", USAGE)
def test_usage(
    tmp_path: Path, case: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(tmp_path)
    monkeypatch.chdir(tmp_path)
    for name in ("full", "empty"):
        Path(name).mkdir()
    Path("full/notes").write_text("mine")
    Path("m.toml").write_text("format = 1")
    arguments, expected = USAGE[case]
    assert main(["import", *arguments]) == 2
    _, errors = lines_of(capsys)
    assert len(errors) == 1 and re.search(expected, errors[0]), errors
    assert Path("m.toml").read_text() == "format = 1" and not Path("new").exists()


@pytest.mark.parametrize("where", ["read_groups", "check_all", "write_set"])
def test_interrupted_anywhere_leaves_nothing(
    tmp_path: Path, where: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl+C while reading, comparing or writing: exit code 130, and no file that was not there before."""
    write_log(tmp_path)
    mapping = write_mapping(
        tmp_path, ["run.csv"], '"motor_pos_#"', '"motor_torque_#"', time='column = "time"'
    )
    before = sorted(tmp_path.iterdir())
    work = getattr(importing, where)

    def interrupted(*arguments: Any, **keys: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return work(*arguments, **keys)

    monkeypatch.setattr(importing, where, interrupted)
    assert main(["import", str(mapping), "--out", str(tmp_path / "set")]) == 130
    assert sorted(tmp_path.iterdir()) == before
    assert "nothing was written" in capsys.readouterr().err


def test_reading_a_bag_can_be_stopped(tmp_path: Path) -> None:
    write_robot(tmp_path)
    write_mcap(tmp_path / "run.mcap", motor_messages(DATA))
    mapping = write_mapping(
        tmp_path, ["run.mcap"], '"/motor_states/joint#/position"', '"/motor_states/joint#/effort"'
    )
    with pytest.raises(Cancelled):
        import_logs(mapping, tmp_path / "set", should_stop=lambda: True)


def test_questions_on_a_terminal(tmp_path: Path) -> None:
    """On a terminal the command asks for what it does not know, and writes the answer into the mapping."""
    columns = {"time": DATA.time} | {f"motor_pos_{j + 1}": DATA.theta[:, j] for j in range(2)}
    columns |= {f"current_{j + 1}": DATA.tau[:, j] / 5 for j in range(2)}
    write_robot(tmp_path)
    pacsv.write_csv(pa.table(columns), tmp_path / "run.csv")
    person, terminal = pty.openpty()
    command = [
        sys.executable,
        "-m",
        "flexviz",
        "import",
        "run.csv",
        "--robot",
        "robot.urdf",
        "--mapping",
        "m.toml",
    ]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        stdin=terminal,
        stderr=terminal,
        stdout=subprocess.PIPE,
        text=True,
        close_fds=True,
    )
    os.close(terminal)
    seen = b""
    answers = [(b"torque constant [Nm/A]", b"5\n"), (b"gear ratio", b"1\n")]
    while True:
        try:
            part = os.read(person, 4096)
        except OSError:  # the other end was closed
            break
        if not part:
            break
        seen += part
        if answers and answers[0][0] in seen:
            seen = seen.split(answers[0][0], 1)[1]
            os.write(person, answers.pop(0)[1])
    os.close(person)
    assert process.stdout is not None
    out = process.stdout.read()
    process.stdout.close()
    assert process.wait(60) == 0 and not answers, out
    text = (tmp_path / "m.toml").read_text()
    assert text.count("torque_constant = 5.0") == 2 and "MISSING" not in text
