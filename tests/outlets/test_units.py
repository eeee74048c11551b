"""A joint that slides has m and N in every output; beside one that turns, each has its own."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz import identify
from flexviz.analysis.acceptance import acceptance_scope
from flexviz.analysis.diagnosis import maps_of
from flexviz.base.facts import Fact
from flexviz.base.units import joint_unit, unit_of_all
from flexviz.checks import Issue, with_sliding
from flexviz.content.charts import Chart, ChartAxis
from flexviz.content.records import JointErrors
from flexviz.content.scene import RobotMotion
from flexviz.content.session import Session, save_session
from flexviz.content.wording import error_whole, sliding_note
from flexviz.data.measurements import read_set
from flexviz.model.effects import EFFECTS
from flexviz.outlets.recording.paths import TITLES, titled
from flexviz.outlets.terminal import main
from flexviz.outlets.view import joints_html
from tests.data.test_import_prismatic import LIFT
from tests.found import GUARD
from tests.small_set import LINK

UNITS = {  # of a lift (slides) that carries an arm (turns)
    "stiffness": ("N/m", "Nm/rad"),
    "motor_inertia": ("kg", "kg m²"),
    "link_viscous_friction": ("N s/m", "Nm s/rad"),
    "motor_viscous_friction": ("N s/m", "Nm s/rad"),
    "viscous_friction_sum": ("N s/m", "Nm s/rad"),
    "coulomb_friction.coulomb": ("N", "Nm"),
    "ixx": ("kg m²", "kg m²"),
    "mx": ("kg m", "kg m"),
}


@pytest.fixture(scope="module")
def lift(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated set of a lift with an arm."""
    folder = tmp_path_factory.mktemp("lift")
    links = {name: LINK.format(name=name) for name in ("link1", "link2")}
    (folder / "lift.urdf").write_text(LIFT.format(**links))
    hidden = ["--effect", "coulomb_friction:lift", "--effect", "coulomb_friction:arm"]
    assert main(["simulate", str(folder / "lift.urdf"), "--out", str(folder / "set"), *hidden]) == 0
    return folder / "set"


def test_units_in_terminal_json_and_truth(lift: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = lift.parent / "result.json"
    effects = ["--effect", "coulomb_friction:lift", "--effect", "coulomb_friction:arm"]
    assert main(["identify", str(lift), "--quick", *effects, "--json", str(file)]) in (0, 1)
    told = capsys.readouterr().out
    result, truth = json.loads(file.read_text()), json.loads((lift / "truth.json").read_text())
    for source in (result, truth):
        units = {(p["name"], p["joint"]): p["unit"] for p in source["parameters"]}
        expected = {
            (name, joint): unit
            for name, row in UNITS.items()
            for joint, unit in zip(("lift", "arm"), row, strict=True)
            if (name, joint) in units
        }
        assert {key: units[key] for key in expected} == expected and len(expected) >= 14
    assert result["residual"]["units"] == ["N", "Nm"]
    hidden = {effect["joint"]: effect["parameters"]["coulomb"]["unit"] for effect in truth["effects"]}
    assert hidden == {"lift": "N", "arm": "Nm"}
    rows = [line.split() for line in told.splitlines()]
    for name, row in UNITS.items():
        for joint, unit in zip(("lift", "arm"), row, strict=True):
            line = next(words for words in rows if words[:2] == [name, joint])
            assert f" {unit} " in f"{' '.join(line)} ", line
    assert "fit [N, Nm]" in told and any(words[:1] == ["lift"] and words[-1] == "N" for words in rows)


def test_units_in_the_report_and_in_exports(lift: Path, tmp_path: Path) -> None:
    measurements = read_set(lift)
    session = Session.of(measurements)
    analysis = session.analysis.with_identification(
        identify(measurements, refine=False), session.analysis.settings
    )
    save_session(session.then("identified", analysis), measurements, tmp_path / "kept")
    assert main(["report", str(tmp_path / "kept"), "--out", str(tmp_path / "report.md")]) == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith("| stiffness |"))
    assert row.count("N/m") == 1 and row.count("Nm/rad") == 1
    places = ["--to", "c", "--to", "python", "--to", "urdf", "--to", "mjcf"]
    assert main(["export", str(tmp_path / "kept"), "--out", str(tmp_path / "out"), *places]) == 0
    note = "Sliding joints (lift): N and m where Nm and rad are written."
    files = [
        file for file in (tmp_path / "out").rglob("*") if file.suffix in (".c", ".h", ".py", ".urdf", ".xml")
    ]
    assert len(files) >= 5
    for file in files:
        words = " ".join(file.read_text(encoding="utf-8").replace(" * ", " ").split())
        assert note in words, file
    urdf = next(file for file in files if file.suffix == ".urdf").read_text(encoding="utf-8")
    assert " N/m " in urdf and " Nm/rad " in urdf


def test_units_of_where_the_residual_is(lift: Path) -> None:
    measurements = read_set(lift)
    model = identify(measurements, refine=False).model
    maps = {(one.joint, one.variable): one.unit for one in maps_of(measurements, model)}
    assert maps["lift", "velocity"] == "m/s" and maps["lift", "load"] == "N" and maps["lift", "time"] == "s"
    assert maps["arm", "velocity"] == "rad/s" and maps["arm", "load"] == "Nm"


def test_units_of_the_set_and_of_effects(lift: Path) -> None:
    assert read_set(lift).torque_units == ("N", "Nm")
    assert EFFECTS["torque_ripple"].units_on(True) == {"amplitude": "N", "order": "rad/m", "phase": "rad"}
    assert EFFECTS["stiffness_hardening"].units_on(True) == {"cubic_stiffness": "N/m³"}
    assert EFFECTS["quadratic_friction"].units_on(True) == {"quadratic": "N s²/m²"}
    assert EFFECTS["torque_delay"].units_on(True) == EFFECTS["torque_delay"].units


def test_one_function_of_the_joints_kind() -> None:
    assert joint_unit("mNm/√Hz", True) == "mN/√Hz" and joint_unit("rad/s⁵", True) == "m/s⁵"
    assert joint_unit("Nm s/(rad K)", True) == "N s/(m K)" and joint_unit("s", True) == "s"
    assert unit_of_all(()) == "Nm" and unit_of_all(("N", "N")) == "N" and unit_of_all(("Nm", "N")) == "N, Nm"
    assert sliding_note(("a", "b"), (False, False)) == ""
    assert titled(TITLES["theta_1"], (True, False)) == "dθ/dt [m/s, rad/s]"
    assert titled(TITLES["tau_0"], (False, False)) == "τ [Nm]"
    chart = Chart("a", "a", ChartAxis("position", "rad"), ChartAxis("residual", "Nm"))
    slides = chart.of_joint(True)
    assert (slides.x.unit, slides.y.unit) == ("m", "N") and chart.of_joint(False).y == chart.y


def test_errors_of_mixed_joints() -> None:
    mixed = JointErrors((3.0, 0.4), (6.0, 4.0), (0.1, 0.01), ("N", "Nm"))
    assert error_whole(mixed, 0) == "50.0 % of the torque (3.00 N)"
    assert error_whole(mixed, 1).endswith("(0.400 Nm)")
    assert error_whole(mixed) == "30.0 % of the torque (3.00 N and 0.400 Nm)"
    assert JointErrors((3.0, 4.0), (), (), ("N", "N")).unit == "N"


def test_units_in_the_app(lift: Path) -> None:
    table = np.array([[0.1, 0.2], [0.3, 0.4]])
    motion = RobotMotion("g", np.array([0.0, 1.0]), table, table, "", torque=table)
    shown = joints_html(("lift", "arm"), None, motion, 0.0, units=("N", "Nm"))
    assert "τ [N, Nm]" in shown and "θ − q [mm, mrad]" in shown
    assert "torque 0.100 N, deflection 100 mm" in shown and "torque 0.200 Nm, deflection 200 mrad" in shown


ISSUES = [  # of one joint; what their sentences state of it where it slides
    (Issue("zero", "odd", ("lift",), "q", {"difference": 0.2}), "0.2 m from"),
    (Issue("reference", "odd", ("lift",), "theta", {"noise": {"lift": 1e-9}}), "e−9 m, less"),
    (Issue("saturated", "odd", ("lift",), "tau",
           {"lower": -3.0, "upper": 3.0, "tolerance": 1e-3, "rows": 9}), "(±3.000 N)"),
    (Issue("unit", "wrong", ("lift",), "tau", {"slopes": {"lift": 0.1}, "stated_gears": {"lift": 5.0}}),
     " N/A)"),
]  # fmt: skip


@pytest.mark.parametrize(("issue", "expected"), ISSUES, ids=[issue.kind for issue, _ in ISSUES])
def test_units_of_issues(lift: Path, issue: Issue, expected: str) -> None:
    (sliding,) = with_sliding([issue], read_set(lift).robot)
    assert sliding.slides == ("lift",) and expected in sliding.message
    (turning,) = with_sliding([replace(issue, joints=("arm",))], read_set(lift).robot)
    told = turning.message.replace(" Nm", " N").replace(" rad", " m")
    assert expected in told and told != turning.message


def test_units_of_facts(lift: Path) -> None:
    measurements = read_set(lift)
    lift_range, arm_range = (str(one.fact) for one in acceptance_scope(measurements).joints)
    assert " m, up to " in lift_range and " m/s and " in lift_range and lift_range.endswith(" N")
    assert " rad, up to " in arm_range and arm_range.endswith(" Nm")
    values = {"variable": "velocity", "size": 3.0, "explained": 0.9, "direction": "both", "kind": "constant"}
    assert "3 N " in Fact("curve-form", values=values | {"unit": "m/s"}).text
    assert "3 Nm " in Fact("curve-form", values=values | {"unit": "rad/s"}).text
    guard = replace(GUARD, units=("N", "N"))
    assert " N between bandwidths" in str(next(guard.facts()))
