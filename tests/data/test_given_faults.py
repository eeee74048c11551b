"""Small inputs of others that once failed: the fault is named."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from shared_data import FAULTS

from flexviz.checks import Issue, issues_of_set
from flexviz.content.wording import issue_message
from flexviz.data.importing import import_logs
from flexviz.data.measurements import read_set
from flexviz.outlets.terminal import main
from tests.cases import slow

pytestmark = pytest.mark.usefixtures("no_delay")


def place(name: str) -> Path:
    """A given input."""
    if not (FAULTS / name).is_dir():
        pytest.skip("the inputs are not here")
    return FAULTS / name


def order_issue(issues: tuple[Issue, ...] | list[Issue]) -> Issue:
    """The only issue, which is of the order."""
    (issue,) = issues
    assert issue.kind == "order" and issue.severity == "wrong"
    return issue


def test_three_permuted_columns() -> None:
    """The second log carried a payload, which its mapping does not state: that is told, too."""
    found = import_logs(place("06-three-columns-permuted") / "map.toml", None).issues
    issue = order_issue([one for one in found if one.kind == "order"])
    assert issue.joints == ("shoulder_yaw", "shoulder_pitch", "elbow") and issue.signal == "theta and tau"
    # the columns hold elbow, yaw, pitch
    assert issue.values["order"] == ("shoulder_pitch", "elbow", "shoulder_yaw")
    (other,) = (one for one in found if one is not issue)
    assert (other.kind, other.severity, other.values["groups"]) == ("payload", "odd", ("t2p2",))


def test_an_angle_in_per_cent_of_the_range() -> None:
    (issue,) = import_logs(place("27-positions-in-percent") / "map.toml", None).issues
    assert (issue.kind, issue.severity) == ("unit", "wrong") and issue.values["per_cent"]
    assert [(fix.key, fix.value) for fix in issue.fixes] == [("unit", 0.031)] * 2


def test_torques_in_per_cent_of_the_rated_ones() -> None:
    """The drives' rated torques are 120 and 60 Nm; payloads are known to 15 %, masses to 25 %."""
    (issue,) = import_logs(place("18-torque-in-percent-of-rated") / "map.toml", None).issues
    assert (issue.kind, issue.severity, issue.values["share"]) == ("rated", "odd", "per cent")
    assert issue.values["rated"] == pytest.approx({"joint1": 120.0, "joint2": 60.0}, rel=0.25)
    assert "per cent of the drives' rated torques" in issue.message and "/ 100" in issue.message


def test_a_reference_is_no_measured_angle() -> None:
    (issue,) = import_logs(place("20-reference-logged-as-position") / "map.toml", None).issues
    assert (issue.kind, issue.joints) == ("reference", ("joint1", "joint2"))
    assert max(issue.values["noise"].values()) < 5e-8  # [rad]


@pytest.mark.parametrize(("name", "signals"), [("joint", "theta and tau"), slow("tau", "tau")])
def test_exchanged_columns(name: str, signals: str) -> None:
    folder = place(f"{name}-columns-swapped")
    issue = order_issue(issues_of_set(read_set(folder, logged=False)))
    assert issue.joints == ("joint1", "joint2") and issue.signal == signals
    command = [sys.executable, "-m", "flexviz", "identify", "--quick", str(folder)]
    told = subprocess.run(command, capture_output=True, text=True, timeout=300).stderr
    assert "the columns of joint1 and joint2 exchanged" in told


@pytest.mark.parametrize("command", ["diagnose", "report", "identify"])
def test_a_set_for_validation_only(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "r.html")] if command == "report" else []
    assert main([command, str(place("all-validation")), *out]) == 2
    assert "there is no group to fit: every group is marked as validation" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_torque_without_gravity() -> None:
    (issue,) = import_logs(place("01-torque-without-gravity") / "map.toml", None).issues
    assert issue.kind == "gravity" and "not that of gravity" in issue_message(issue)
