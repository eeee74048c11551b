"""Acceptance: what passes, what fails, what is refused, and the range for which it holds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.acceptance import NOT_PROVED, acceptance_scope, judge, read_limits
from flexviz.base.errors import InputError
from flexviz.content.results import ResultDocument
from flexviz.data.measurements import read_set
from flexviz.outlets.report import diagnosed_session, session_report
from flexviz.outlets.terminal import main
from tests.found import DIAGNOSIS, JOINTS
from tests.small_set import write_small_set

RESULT = replace(DIAGNOSIS, set_name="small", torque_spread=(2.0, 4.0)).document()
ALL_MET = """
verdict = ["unknown"]
[default]
held_out_percent = 1.1
interval_percent = { stiffness = 1.0, "coulomb_friction.coulomb" = 1.0 }
[joints.joint1]
held_out_torque = 0.03
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "limits.toml"
    file.write_text(text, encoding="utf-8")
    return file


def judged(folder: Path, text: str, result: ResultDocument = RESULT) -> list[tuple[str | None, str, bool]]:
    lines = judge(result, read_limits(written(folder, text), JOINTS), JOINTS).lines
    return [(line.joint, f"{line.what}: {line.found}; {line.required}", line.passed) for line in lines]


def test_figures_and_limits(tmp_path: Path) -> None:
    """The held-out errors of the last step are 21 and 31 mNm, the torques vary by 2 and 4 Nm."""
    assert judged(tmp_path, ALL_MET) == [
        (None, "verdict: unknown; unknown", True),
        ("joint1", "held-out error: 1.05 % of the torque (21.0 mNm); at most 1.1 % of the torque", True),
        ("joint1", "held-out error: 0.0210 Nm (1.05 % of the torque); at most 0.03 Nm", True),
        ("joint2", "held-out error: 0.775 % of the torque (31.0 mNm); at most 1.1 % of the torque", True),
        ("joint1", "95 % interval of stiffness: 0.207 % of the value; at most 1 % of the value", True),
        ("joint2", "95 % interval of stiffness: 0.207 % of the value; at most 1 % of the value", True),
        ("joint2", "95 % interval of coulomb friction: 0.653 % of the value; at most 1 % of the value", True),
    ]


@pytest.mark.parametrize(
    "text, joint, line",
    [
        ('verdict = ["nothing-missing"]', None, "verdict: unknown; nothing-missing"),
        (
            "[joints.joint2]\nheld_out_percent = 0.7",
            "joint2",
            "held-out error: 0.775 % of the torque (31.0 mNm); at most 0.7 % of the torque",
        ),
        (
            "[default]\ninterval_percent = { motor_inertia = 0.2 }\n[joints.joint2]\n"
            "interval_percent = { motor_inertia = 0.3 }",
            "joint1",
            "95 % interval of motor inertia: 0.275 % of the value; at most 0.2 % of the value",
        ),
        (
            "[joints.joint1]\ninterval_percent = { mass = 1000 }",
            "joint1",
            "95 % interval of mass: not determined; at most 1000 % of the value",
        ),
        (
            '[joints.joint1]\ninterval_percent = { "coulomb_friction.coulomb" = 5 }',
            "joint1",
            "95 % interval of coulomb friction: not in the model; at most 5 % of the value",
        ),
        (
            '[default]\ninterval_percent = { "backlash.half_width" = 5 }',
            None,
            "95 % interval of backlash · half width: not in the model; at most 5 % of the value",
        ),
    ],
)
def test_what_fails(text: str, joint: str | None, line: str, tmp_path: Path) -> None:
    assert [one for one in judged(tmp_path, text) if not one[2]] == [(joint, line, False)]


def test_nothing_held_out_is_not_met(tmp_path: Path) -> None:
    (last,) = DIAGNOSIS.steps[-1:]
    fitted = replace(DIAGNOSIS, torque_spread=(2.0, 4.0), steps=(replace(last, rms_validation=None),))
    lines = judged(tmp_path, "[joints.joint1]\nheld_out_torque = 9", fitted.document())
    assert lines == [("joint1", "held-out error: no group is held out; at most 9 Nm", False)]


@pytest.mark.parametrize(
    "text, says",
    [
        ("verdct = []", 'verdct: unknown key "verdct"; did you mean "verdict"?'),
        ("[default]\nheld_out_times_noise = 3", "default.held_out_times_noise: unknown key"),
        ('verdict = ["fine"]', 'verdict, entry 1: found "fine", expected "missing", "nothing-missing",'),
        ("[default]\nheld_out_percent = -3", "default.held_out_percent: found -3, expected a number above 0"),
        ('[default]\nheld_out_percent = "5"', 'default.held_out_percent: found "5", expected a number'),
        ("[joints.elbow]\nheld_out_percent = 3", "joints.elbow: no such joint in the set; valid: joint1"),
        (
            "[default]\ninterval_percent = { stifness = 3 }",
            'no parameter "stifness"; did you mean "stiffness"',
        ),
        ("format = 2", "format: found 2, this program reads format 1"),
        ("format = 1", "has no limit, expected verdict, or one of held_out_percent"),
        ("[default", "not valid TOML"),
    ],
)
def test_wrong_files_name_the_key(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        read_limits(written(tmp_path, text), JOINTS)
    assert says in str(refused.value) and "limits.toml" in str(refused.value)


def test_result_of_other_joints_is_refused(tmp_path: Path) -> None:
    limits = read_limits(written(tmp_path, "[default]\nheld_out_percent = 3"), ("a", "b"))
    with pytest.raises(InputError, match="of the joints joint1, joint2, the set has a, b"):
        judge(RESULT, limits, ("a", "b"))


def test_range_is_that_of_the_held_out_motion(tmp_path: Path) -> None:
    """Compared with the raw samples and their finite differences."""
    measurements = read_set(write_small_set(tmp_path / "small"))
    found = acceptance_scope(measurements)
    (held_out,) = measurements.validation_groups
    assert found.held_out and found.groups == (held_out.name,)
    (segment,) = held_out.segments
    speed = np.abs(np.gradient(segment.theta, segment.step, axis=0)).max(axis=0)
    for j, one in enumerate(found.joints):
        assert (one.low, one.high) == (segment.theta[:, j].min(), segment.theta[:, j].max())
        assert one.torque == np.abs(segment.tau[:, j]).max()
        assert one.speed == pytest.approx(speed[j], rel=0.02)
    assert found.payloads == {"p1": 0.0} and not found.temperatures


def test_report_has_the_section(tmp_path: Path) -> None:
    measurements = read_set(write_small_set(tmp_path / "small"))
    session = diagnosed_session(measurements, DIAGNOSIS)
    limits = read_limits(written(tmp_path, "[default]\nheld_out_torque = 0.025\n"), JOINTS)
    page = session_report(session, measurements, "md", limits=limits)
    assert "## Acceptance" in page and "Not accepted: 1 of 2 requirements are met." in page
    assert "| pass | joint1 | held-out error | 0.0210 Nm | at most 0.025 Nm |" in page
    assert "| **fail** | joint2 | held-out error | 0.0310 Nm | at most 0.025 Nm |" in page
    assert all(fact.text in page for fact in NOT_PROVED)
    numbers = json.loads(session_report(session, measurements, "json", limits=limits))["acceptance"]
    assert numbers["passed"] is False and [line["passed"] for line in numbers["lines"]] == [True, False]
    assert "Acceptance" not in session_report(session, measurements, "md")


def test_command_passes_fails_and_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, saved, out = write_small_set(tmp_path / "small"), tmp_path / "result.json", tmp_path / "out.json"
    found = replace(DIAGNOSIS, set_name="small", torque_spread=(2.0, 4.0))
    monkeypatch.setattr("flexviz.analysis.diagnosis.diagnose", lambda *given, **named: found)
    call = ["verify", str(folder), "--require", str(written(tmp_path, ALL_MET)), "--json", str(out)]
    assert main(call) == 0
    shown, document = capsys.readouterr().out, json.loads(out.read_text())
    assert "Accepted: 7 of 7 requirements are met." in shown and "This does not prove:" in shown
    assert document["passed"] and len(document["lines"]) == 7 and document["scope"]["held_out"]

    written(tmp_path, "[default]\nheld_out_percent = 1")
    assert main(["diagnose", str(folder), "--apply", "--json", str(saved)]) == 0
    capsys.readouterr()
    monkeypatch.setattr("flexviz.analysis.diagnosis.diagnose", None)  # a saved result needs no diagnosis
    assert main([*call, "--result", str(saved)]) == 1
    shown = capsys.readouterr().out
    assert "fail joint1 held-out error 1.05 % of the torque (21.0 mNm) at most 1 % of the torque" in " ".join(
        shown.split()
    )
    assert "Not accepted: 1 of 2 requirements are met." in shown and not json.loads(out.read_text())["passed"]

    table = folder / "a.csv"
    table.write_text(table.read_text()[:-1])
    assert main([*call, "--result", str(saved)]) == 2
    assert "is a result of small with other data" in capsys.readouterr().err
    written(tmp_path, "[default]\nheld_out = 1")
    assert main(call) == 2
    assert 'default.held_out: unknown key "held_out"; did you mean' in capsys.readouterr().err
