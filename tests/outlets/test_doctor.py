"""`flexviz doctor`: what is in order, what is missing, and the advice."""

from __future__ import annotations

import socket
from importlib import metadata
from pathlib import Path

import pytest

from flexviz.outlets import doctor
from flexviz.outlets.terminal import main


def test_this_machine(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(doctor, "check_webgl", lambda browser: doctor.Check("WebGL", "ok", "a card"))
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert "flexviz can run here" in said and "pinocchio" in said and str(doctor.APP_PORT) in said


def test_packages() -> None:
    version = metadata.version("numpy")
    wanted = [f"numpy=={version}", "numpy<1", "no-such-package>=2", 'no-such-extra>=1; extra == "batch"']
    *found, summary = doctor.check_packages([*wanted, 'other>1; python_version < "3"'])
    assert [c.state for c in found] == ["warning", "problem", "warning"]
    assert 'pip install "numpy<1"' in found[0].text and 'pip install "no-such-package>=2"' in found[1].text
    assert summary.text.startswith("1 of 3") and summary.state == "warning"
    assert doctor.check_binary("no_such_module").state == "problem"


def test_a_taken_port_and_an_unwritable_folder(tmp_path: Path) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        assert doctor.check_port(other.getsockname()[1]).state == "warning"
    assert doctor.check_disk(tmp_path).state == "ok"
    check = doctor.check_disk(tmp_path / "missing")
    assert check.state == "problem" and "TMPDIR" in check.text


def test_memory() -> None:
    assert doctor.check_memory(2e9, 4).state == "warning" and doctor.check_memory(8e9, 4).state == "ok"
    assert doctor.check_memory(float("inf"), 2).text == "2 cores"
    assert doctor.available_memory() > 0


@pytest.mark.parametrize(
    ("page", "state"),
    [
        ("<body>renderer=ANGLE (NVIDIA RTX);</body>", "ok"),
        ("<body>renderer=ANGLE (Google, SwiftShader driver);</body>", "warning"),
        ("<body>renderer=none;</body>", "problem"),
        ("", "warning"),
    ],
)
def test_renderers(page: str, state: str) -> None:
    assert doctor.judge_renderer("chromium", page).state == state


def test_no_browser_and_one_that_fails(tmp_path: Path) -> None:
    assert doctor.check_webgl(None).state == "warning"
    assert "did not answer" in doctor.check_webgl(str(tmp_path / "chromium")).text
