"""`flexviz review`: what it says, makes, compares and serves."""

from __future__ import annotations

import re
import signal
import socket
import stat
import subprocess
import sys
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.base.errors import InputError
from flexviz.content.comparing import compare, effects_of
from flexviz.content.session import save_session
from flexviz.outlets.recording import read_recording, record_set, viewers
from flexviz.outlets.recording.viewers import free_port, has_display, show_in_window, web_viewer
from flexviz.outlets.terminal import main
from tests.found import DIAGNOSIS
from tests.recorded import Read
from tests.small_session import small_session


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return small_session(tmp_path_factory.mktemp("set") / "small")


@pytest.fixture(scope="module")
def files(session: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two recordings: a result, and one that differs from it in a parameter, an effect and its errors."""
    measurements, analyses = session
    result = analyses.analysis.identification
    short = replace(measurements, groups=measurements.groups[:1])
    first = next(p for p in result.parameters if p.name == "stiffness" and p.std < p.value)
    other = replace(
        result,
        parameters=tuple(
            replace(p, value=p.value + 10 * p.std) if p is first else p for p in result.parameters
        ),
        model=replace(result.model, effects=()),
        residual=replace(result.residual, rms=(3.0, 4.0)),
    )
    folder = tmp_path_factory.mktemp("recordings")
    runs = ((folder / "a.rrd", result, None), (folder / "b.rrd", other, DIAGNOSIS))
    for file, shown, diagnosis in runs:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("flexviz.outlets.recording.writing.RecordingFile.simulate", lambda *a: None)
            record_set(short, shown, file, samples=100, diagnosis=diagnosis, label=file.stem)
    return runs[0][0], runs[1][0]


def review(capfd: Any, *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output, standard error."""
    code = main(["review", *(str(argument) for argument in arguments)])
    captured = capfd.readouterr()
    return code, captured.out, captured.err


def test_what_a_recording_says(files: tuple[Path, Path], session: Any) -> None:
    found = read_recording(files[1])
    measurements, analyses = session
    assert (found.set_name, found.robot) == (measurements.name, measurements.robot.name)
    assert (found.joints, found.groups) == (measurements.joints, ("g1",)) and not found.simulated
    (result,), (diagnosis,) = found.results, found.diagnoses
    assert result["label"] == "b" and result["effects"] == [] and result["residual"]["rms"] == [3.0, 4.0]
    assert diagnosis == DIAGNOSIS.to_dict()
    effects = read_recording(files[0]).results[0]["effects"]
    assert effects == [e.text for e in analyses.analysis.identification.model.effects] and effects


def test_check(files: tuple[Path, Path], capfd: Any) -> None:
    code, out, _ = review(capfd, files[1], "--check")
    assert code == 0
    for words in (
        "b.rrd: complete",
        "SHA-256: matches",
        "result 1, b: error ",
        "% of the torque (",
        "verdict: Missing: Coulomb",
    ):
        assert words in out


def test_a_truncated_one_is_named(files: tuple[Path, Path], tmp_path: Path, capfd: Any) -> None:
    raw = files[0].read_bytes()
    (tmp_path / "cut.rrd").write_bytes(raw[: len(raw) * 9 // 10])
    code, _, err = review(capfd, tmp_path / "cut.rrd", "--check")
    assert code == 2 and "is truncated" in err and "python -m rerun rrd optimize" in err


def test_bad_input_is_named(files: tuple[Path, Path], session: Any, tmp_path: Path, capfd: Any) -> None:
    (tmp_path / "garbage.rrd").write_bytes(b"garbage" * 99)
    for arguments, words in (
        ([tmp_path / "nothing.rrd"], r"nothing\.rrd: cannot be read"),
        ([tmp_path / "garbage.rrd"], r"garbage\.rrd: is not a readable Rerun recording"),
        ([session[0].path], r"neither a recording nor a session; .*`flexviz record`"),
        ([files[0], "--out", tmp_path / "x.rrd"], "--out keeps the recording made of a session"),
        ([*files, "--out", tmp_path / "x.rrd"], "--out keeps the recording made of a session"),
        ([files[0], "--check", "--out", tmp_path / "no" / "x.rrd"], "does not exist"),
    ):
        code, out, err = review(capfd, *arguments)
        assert code == 2 and re.search(words, err) and err.count("\n") == 1 and not out
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["garbage.rrd"]


def test_a_session_becomes_a_recording(session: Any, tmp_path: Path, capfd: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr("flexviz.outlets.recording.writing.RecordingFile.simulate", lambda *a: None)
    measurements, analyses = session
    save_session(analyses.with_note("look at joint 2"), measurements, tmp_path / "kept")
    code, out, _ = review(capfd, tmp_path / "kept", "--check", "--out", tmp_path / "kept.rrd")
    assert code == 0 and "result 1" in out and "verdict: Missing: Coulomb friction on joint2" in out
    content = Read(tmp_path / "kept.rrd")
    steps = list(content.component("/__properties/session", "steps"))
    assert steps == [step.label for step in analyses.steps]
    assert list(content.component("/__properties/session", "notes")) == ["look at joint 2"]
    assert "look at joint 2" in content.text("/log") and "identified" in content.text("/log")
    found = read_recording(tmp_path / "kept.rrd")
    expected = analyses.analysis.identification
    assert [result["parameters"] for result in found.results] == [expected.to_dict()["parameters"]]


# -- two of them -------------------------------------------------------------------------------------


def test_differences(files: tuple[Path, Path]) -> None:
    a, b = (read_recording(file) for file in files)
    found = compare([a.known, b.known])
    (row,) = (row for row in found.rows if row.differs)
    assert row.name == "stiffness" and row.deviations == pytest.approx(10 / 2**0.5)
    first, second = found.results
    assert second.rms == (3.0, 4.0) and (first.effects, second.effects) == (
        tuple(a.results[0]["effects"]),
        (),
    )
    assert not any(row.differs for row in compare([a.known, a.known]).rows)


def test_a_diagnosis_of_another_model_is_not_that_of_the_result(files: tuple[Path, Path]) -> None:
    found = read_recording(files[1])
    assert found.diagnoses and found.known.diagnosis is None
    own = effects_of(DIAGNOSIS.document())
    same = replace(found, results=({**found.results[0], "effects": list(own)},)).known
    assert same.diagnosis is not None and same.diagnosis.verdict == DIAGNOSIS.verdict


def test_two_are_compared(files: tuple[Path, Path], capfd: Any) -> None:
    code, out, _ = review(capfd, *files, "--check")
    assert code == 0 and "error, fitted" in out and "7.1 !" in out and "standard errors" in out


def test_only_flexviz_recordings_can_be_compared(
    files: tuple[Path, Path], tmp_path: Path, capfd: Any
) -> None:
    import rerun as rr

    with rr.RecordingStream("something else") as stream:
        stream.save(tmp_path / "other.rrd")
        stream.log("x", rr.Scalars(1.0))
    code, out, _ = review(capfd, tmp_path / "other.rrd", "--check")
    assert code == 0 and "not a flexviz recording" in out
    code, _, err = review(capfd, files[0], tmp_path / "other.rrd", "--check")
    assert code == 2 and "other.rrd: only recordings of flexviz can be compared" in err


# -- viewers -----------------------------------------------------------------------------------------


def test_the_page_fetches_nothing_from_outside(files: tuple[Path, Path]) -> None:
    with web_viewer(files, 0) as address:
        base = address.partition("/?")[0]
        with urllib.request.urlopen(address) as answer:
            page, policy = answer.read().decode(), answer.headers["Content-Security-Policy"]
        assert not re.search(r"<link[^>]*https?://", page) and "re_viewer.js" in page
        assert "default-src 'self'" in policy and "connect-src 'self'" in policy and "http" not in policy
        assert address.count("url=http%3A%2F%2F127.0.0.1") == 2
        for number, file in enumerate(files):
            with urllib.request.urlopen(f"{base}/recordings/{number}/{file.name}") as answer:
                assert answer.read() == file.read_bytes()
        for path in ("/recordings/0/../../etc/passwd", "/x", "/recordings/1/a.rrd", "/recordings/"):
            with pytest.raises(urllib.error.HTTPError) as caught:
                urllib.request.urlopen(base + path)
            assert caught.value.code == 404
        bent = urllib.request.Request(address, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError) as caught:
            urllib.request.urlopen(bent)
        assert caught.value.code == 403
        with (
            pytest.raises(InputError, match="cannot be used"),
            web_viewer(files, int(base.rpartition(":")[2])),
        ):
            pass


def test_ports_taken_meanwhile_are_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind((viewers.HOST, 0))
        port = taken.getsockname()[1]
        ports = iter([port, port])
        monkeypatch.setattr(viewers, "free_port", lambda: next(ports, None) or free_port())
        assert b"re_viewer" in viewers.viewer_page()["/"]
        assert next(ports, None) is None


def test_the_command_serves_until_interrupted(files: tuple[Path, Path]) -> None:
    command = [
        sys.executable,
        "-m",
        "flexviz",
        "review",
        str(files[0]),
        "--web",
        "--no-browser",
        "--port",
        "0",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        address = next(line for line in process.stdout if line.startswith("http://127.0.0.1:")).strip()
        with urllib.request.urlopen(address) as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
        assert process.returncode == 0 and "Traceback" not in err
    finally:
        process.kill()


def test_a_window(tmp_path: Path, files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "rerun"
    program.write_text(
        f'#!/bin/sh\necho "$CI $*" > {tmp_path}/said\ncase "$1" in *b.rrd) echo bad >&2; exit 3;; esac\n'
    )
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setattr(viewers, "rerun_program", lambda: program)
    assert show_in_window([files[0]]) == ""
    said = (tmp_path / "said").read_text()
    assert said.startswith(f"1 {files[0]}") and "--bind 127.0.0.1" in said
    assert show_in_window([files[1]]) == "bad"


def test_displays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not has_display()
    monkeypatch.setenv("DISPLAY", ":0")
    assert has_display()
