"""What contradicts a recording is the same in the terminal, JSON, a report, the app and Python."""

from __future__ import annotations

import json
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest
from shared_data import FAULTS

from flexviz import diagnose, identify
from flexviz.checks import issues_of_set
from flexviz.content.rendering import panel
from flexviz.content.topics import set_blocks
from flexviz.content.wording import issue_text
from flexviz.data.measurements import read_set
from flexviz.outlets.app.sets import cached_set

SETS = ("joint-columns-swapped", "tau-columns-swapped")


def flexviz(*words: str) -> str:
    """What a command says."""
    command = [sys.executable, "-m", "flexviz", *words]
    return " ".join(subprocess.run(command, capture_output=True, text=True, timeout=600).stderr.split())


@pytest.mark.parametrize("name", SETS)
def test_every_outlet_states_the_same(name: str, tmp_path: Path) -> None:
    folder = FAULTS / name
    if not folder.is_dir():
        pytest.skip("the inputs are not here")
    measurements = read_set(folder, logged=False)
    wanted = [issue_text(issue) for issue in issues_of_set(measurements) if issue.severity == "wrong"]
    assert wanted

    found = identify(measurements, refine=False)  # Python
    assert [entry.message for entry in found.recording] == wanted
    assert [one["message"] for one in found.to_dict()["recording"]] == wanted  # JSON
    assert all(text in " ".join(found.summary().split()) for text in wanted)
    page = unescape(panel(set_blocks(cached_set(folder))))  # the app
    assert all(text in page for text in wanted)
    report = tmp_path / "r.md"
    said = [flexviz("identify", "--quick", str(folder)), flexviz("report", str(folder), "--out", str(report))]
    assert all(text in said[0] for text in wanted)  # terminal
    assert all(text in report.read_text(encoding="utf-8") for text in wanted)


def test_a_diagnosis_states_it_too() -> None:
    folder = FAULTS / SETS[0]
    if not folder.is_dir():
        pytest.skip("the inputs are not here")
    found = diagnose(folder)
    assert [entry.kind for entry in found.recording] == ["order"]
    assert json.loads(json.dumps(found.to_dict()))["recording"][0]["joints"] == ["joint1", "joint2"]
