"""The command line as scripts see it: exit codes, one-line errors, the JSON contract."""

from __future__ import annotations

import io
import json
import math
import os
import re
import signal
import stat
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from pydantic import BaseModel, ConfigDict

from flexviz.base.errors import InputError
from flexviz.base.iteration import Iteration
from flexviz.base.progress import Progress
from flexviz.content.wording import interval
from flexviz.outlets.terminal import main, terminal
from flexviz.outlets.terminal.options import parse_bandwidth

COMMANDS = ("identify", "simulate", "serve", "record", "effects", "diagnose", "export")


@pytest.fixture(scope="session")
def demo_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The planar arm's demonstration set, simulated."""
    folder = tmp_path_factory.mktemp("cli") / "demo"
    assert main(["simulate", "planar-2r", "--out", str(folder), "--seed", "1"]) == 0
    return folder


class Contract(BaseModel):
    """What scripts rely on; further keys are allowed."""

    model_config = ConfigDict(strict=True)


class ObserverEntry(Contract):
    name: str
    bandwidth: float | list[float]


class Parameter(Contract):
    name: str
    joint: str | None
    value: float
    std: float | None
    unit: str
    identifiable: Literal["yes", "weak", "no"]
    tied_to: list[str]


class Residual(Contract):
    joints: list[str]
    rms: list[float]
    rms_validation: list[float] | None
    noise_floor: list[float]


class IdentifyContract(Contract):
    format: Literal[1]
    set: str
    observer: ObserverEntry
    groups: list[str]
    validation_groups: list[str]
    converged: bool
    iterations: int
    seconds: float
    parameters: list[Parameter]
    residual: Residual


def lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.strip()]


# -- help and usage


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("flexviz ")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    assert f"flexviz {command}" in capsys.readouterr().out


def test_without_a_command_the_help_goes_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and all(command in captured.err for command in COMMANDS)


HEAVY = ("numpy", "scipy", "pinocchio", "pyarrow", "pydantic", "viser", "rerun", "trimesh", "yourdfpy")


def test_help_loads_nothing_heavy() -> None:
    """What makes a command slow to answer is what it imports."""
    code = (
        "import sys\n"
        "from flexviz.outlets.terminal import main\n"
        "try:\n    status = main(['--help'])\nexcept SystemExit as end:\n    status = end.code\n"
        f"print('loaded', sorted(set({HEAVY!r}) & set(sys.modules)), status or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert "loaded [] 0" in done.stdout and "diagnose" in done.stdout


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["frobnicate"], "frobnicate"),
        (["identify"], "SET"),
        (["identify", "{set}", "--bandwith", "3"], "--bandwidth"),
        (["identify", "nowhere"], "nowhere"),
        (["identify", "{set}", "--bandwidth", "fast"], "fast"),
        (["identify", "{set}", "--bandwidth", "-3"], "-3"),
        (["identify", "{set}", "--bandwidth", "nan"], "nan"),
        (["identify", "{set}", "--bandwidth", "30,40,50"], "3 numbers"),
        (["identify", "{set}", "--observer", "eso", "--gains", "1,2,3"], "6 or 12"),
        (["identify", "{set}", "--observer", "eso", "--gains", "1,1,1,1,1,99"], "unstable"),
        (["identify", "{set}", "--gains", "240,24e3,1.28e6,3.84e7,6.144e8,4.096e9"], "no gains to set"),
        (["identify", "{set}", "--observer", "esso"], "eso"),
        (["identify", "{set}", "--group", "g99"], "g99"),
        (["identify", "{set}", "--effect", "coulomb"], "coulomb_friction"),
        (["identify", "{set}", "--effect", "coulomb_friction:elbow"], "elbow"),
        (["identify", "{set}", "--json", "{set}/no/such/folder.json"], "does not exist"),
        (["identify", "{set}", "--json", "{set}"], "is a folder"),
        (["identify", "{set}", "--json", "{set}/measurements.toml"], "is not a .json file"),
        (["record", "{set}", "--out", "{set}/measurements.toml"], "is not a .rrd file"),
        (["simulate", "planar-3r", "--out", "{set}/x"], "planar-2r"),
        (["simulate", "planar-2r"], "--out"),
        (["simulate", "planar-2r", "--out", "{set}"], "{set}"),
        (["simulate", "planar-2r", "--out", "{set}/x", "--effect", "backslash"], "backlash"),
        (["simulate", "paper-b", "--out", "{set}/x", "--start", "sideways"], "sideways"),
        (["serve", "nowhere", "--no-browser"], "nowhere"),
        (["record", "nowhere", "--out", "{set}/x.rrd"], "nowhere"),
        (["record", "{set}"], "--out"),
        (["record", "{set}", "--out", "{set}/no/folder.rrd"], "folder"),
        (["record", "{set}", "--out", "{set}/x.txt"], "ends in .rrd"),
        (["review", "{set}/x.rrd", "--out", "{set}/x.txt"], "ends in .rrd"),
        (["effects", "backslash"], 'did you mean "backlash"?'),
        (["effects", "--json", "{set}/no/such/folder.json"], "does not exist"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], says: str, demo_set: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    filled = [argument.replace("{set}", str(demo_set)) for argument in arguments]
    before = sorted(demo_set.rglob("*"))
    assert main(filled) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(lines(captured.err)) == 1, captured.err
    assert says.replace("{set}", str(demo_set)) in captured.err
    assert sorted(demo_set.rglob("*")) == before


# -- identify


@pytest.fixture(scope="session")
def identified(demo_set: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, str, str]:
    """The JSON, standard output and standard error of one run."""
    file = tmp_path_factory.mktemp("json") / "result.json"
    run = subprocess.run(
        [sys.executable, "-m", "flexviz", "identify", str(demo_set), "--refine", "--json", str(file)],
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(file.read_text()), run.stdout, run.stderr


def test_json_follows_the_contract(identified: tuple[dict, str, str], demo_set: Path) -> None:
    result = IdentifyContract.model_validate(identified[0])
    joints = result.residual.joints
    assert joints == ["joint1", "joint2"] and result.converged
    assert result.observer.name == "butterworth-zero-phase"
    assert not set(result.groups) & set(result.validation_groups)
    found = {(p.name, p.joint) for p in result.parameters}
    for joint in joints:
        for name in ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction"):
            assert (name, joint) in found
        assert {("viscous_friction_sum", joint), ("mass", joint), ("mx", joint), ("izz", joint)} <= found
    for column in (result.residual.rms, result.residual.noise_floor):
        assert len(column) == len(joints) and all(value > 0.0 for value in column)


def test_json_agrees_with_truth(identified: tuple[dict, str, str], demo_set: Path) -> None:
    truth = json.loads((demo_set / "truth.json").read_text())
    true = {(p["name"], p["joint"]): p["value"] for p in truth["parameters"]}
    checked = 0
    for p in identified[0]["parameters"]:
        if p["name"] in ("stiffness", "motor_inertia") and p["identifiable"] == "yes":
            assert p["value"] == pytest.approx(true[p["name"], p["joint"]], rel=0.01)
            checked += 1
    assert checked >= 2


def test_results_on_stdout_progress_on_stderr(identified: tuple[dict, str, str]) -> None:
    _, out, err = identified
    for text in ("stiffness", "motor_inertia", "Nm/rad", "held out", "refined", "joint2"):
        assert text in out
    assert "iteration" in err and "stiffness" not in err
    assert "\x1b" not in out + err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_keeps_what_it_has(demo_set: Path, tmp_path: Path, number: signal.Signals) -> None:
    """Ctrl+C, or a scheduler, at the first sign of an iteration: exit code 130, and the JSON is there."""
    file = tmp_path / "result.json"
    process = subprocess.Popen(
        [sys.executable, "-m", "flexviz", "identify", str(demo_set), "--refine", "--json", str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    first = next(line for line in process.stderr if "iteration" in line)  # after the checks of the set
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130, first + err
    assert "stopping" in err and "Traceback" not in err
    result = IdentifyContract.model_validate(json.loads(file.read_text()))
    assert not result.converged and result.parameters
    assert "stopped" in out


def test_an_interrupt_while_the_command_is_loaded_ends_it_silently(tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("import time; print('loading', flush=True); time.sleep(60)")
    process = subprocess.Popen(
        [sys.executable, "-m", "flexviz", "--help"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
    )
    assert process.stdout is not None and process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGINT and err == ""


def test_a_part_of_a_name_is_enough_for_a_suggestion(
    demo_set: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(demo_set), "--effect", "colomb"]) == 2
    assert 'did you mean "coulomb_friction"?' in capsys.readouterr().err


def test_a_name_that_is_too_long_is_cut(demo_set: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", str(demo_set), "--group", "a" * 5000]) == 2
    assert len(capsys.readouterr().err) < 400


def test_interrupt_in_the_middle_of_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    class Busy(io.StringIO):
        writing = False

        def write(self, text: str) -> int:
            assert not self.writing, "written to again from the signal's handler"
            self.writing = True
            if not should_stop():
                signal.raise_signal(signal.SIGINT)
            self.writing = False
            return super().write(text)

    with terminal.interruptible() as should_stop:
        monkeypatch.setattr(sys, "stderr", Busy())
        terminal.note("line")
        assert should_stop()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


# -- record and serve


@pytest.mark.slow
def test_record_writes_a_recording(
    demo_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "demo.rrd"
    capsys.readouterr()
    assert main(["record", str(demo_set), "--out", str(file), "--group", "t1p1"]) == 0
    captured = capsys.readouterr()
    assert str(file) in captured.out and "fitted on t1p1" in captured.out and "iteration" in captured.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["demo.rrd", "demo.rrd.sha256"]


def test_serve_answers_until_interrupted(demo_set: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "flexviz", "serve", str(demo_set), "--port", "0", "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+", line)
        assert found, line
        with urllib.request.urlopen(found.group(), timeout=60) as page:
            assert page.status == 200
        process.send_signal(signal.SIGINT)
        err = process.communicate(timeout=60)[1]
    finally:
        process.kill()
    assert process.returncode == 130 and "Traceback" not in err, err


# -- pieces


@pytest.mark.parametrize("text, value", [(None, None), ("50", 50.0), ("40,60", (40.0, 60.0)), ("1e2", 100.0)])
def test_parse_bandwidth(text: str | None, value: object) -> None:
    assert parse_bandwidth(text) == value


def test_json_is_whole_or_absent(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    terminal.write_json(file, {"x": [1.0, math.nan, math.inf], "y": (1, None)})
    assert json.loads(file.read_text()) == {"x": [1.0, None, None], "y": [1, None]}
    with pytest.raises(TypeError):
        terminal.write_json(file, {"x": object()})
    assert json.loads(file.read_text())["y"] == [1, None]
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(file.stat().st_mode) == 0o666 & ~umask


def test_output_file_is_checked_before_the_work(tmp_path: Path) -> None:
    terminal.check_output_file(tmp_path / "new.json")
    with pytest.raises(InputError, match="does not exist"):
        terminal.check_output_file(tmp_path / "no" / "new.json")


@pytest.mark.parametrize(
    "value, std, shown",
    [
        (1000.2345, 0.4, ("1000.2", "0.8")),
        (-12.34, 0.5, ("−12.34", "0.98")),
        (-0.001, 0.5, ("0.00", "0.98")),
        (3.0, None, ("3.000", "–")),
        (3.0, math.inf, ("3.000", "–")),
    ],
)
def test_intervals_of_tables(value: float, std: float | None, shown: tuple[str, str]) -> None:
    assert interval(value, std) == shown


def test_sparse_lines_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal.Reporter("work") as report:
        for count in range(100):
            report(Progress(f"reading {count // 50}", count / 100))
        report(Progress("solving", iteration=Iteration(3, "", 1.5, 0.1, np.zeros(1), ("a",))))
    assert lines(capsys.readouterr().err) == [
        "  0 % reading 0",
        " 50 % reading 1",
        "solving iteration 3  cost 1.5  step 0.1",
    ]
