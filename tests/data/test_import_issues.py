"""Each fault put into good data is named, with what undoes it; good data raise none."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from import_data import JOINTS, truth, write_mapping, write_robot

from flexviz.base.errors import Cancelled
from flexviz.checks import (
    Issue,
    LoadedTable,
    check_groups,
    with_plausibility_warnings,
)
from flexviz.content.wording import issue_message, issue_text
from flexviz.data.importing import import_logs
from flexviz.data.importing.delays import delay_issues, torque_delay
from flexviz.data.logs.mapping import Fix, Mapping, parse
from flexviz.data.measurements import GroupTable, MeasurementSet, read_set
from flexviz.outlets.terminal import analysis
from flexviz.robot.robot import Robot
from tests.cases import slow

DEGREE = np.pi / 180


@cache
def arm() -> tuple[Robot, tuple[SimpleNamespace, ...]]:
    """A planar arm that gravity loads, and two motions of it."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        robot = Robot.load(write_robot(Path(folder)), JOINTS)
    return robot, (truth(0, 1500), truth(5, 1500))


def mapping_of(joints: Any, **keys: Any) -> Mapping:
    """A mapping of joints with all signals and these keys."""
    entry = {joint: {"theta": f"t{joint}", "tau": f"u{joint}", "q": f"q{joint}", **keys} for joint in joints}
    return parse({"robot": "x", "logs": [{"file": "a", "group": "a"}], "joints": entry}, Path("m"))


def with_fixes(mapping: Mapping, fixes: tuple[Fix, ...]) -> Mapping:
    """The mapping with these changes."""
    joints = dict(mapping.joints)
    for fix in fixes:
        entry = joints[fix.joint]
        changed = getattr(entry, fix.signal).model_copy(update={fix.key: fix.value})
        joints[fix.joint] = entry.model_copy(update={fix.signal: changed})
    return mapping.model_copy(update={"joints": joints})


def tables(theta: Any = 1.0, tau: Any = 1.0, q: Any = 1.0, zero: Any = 0.0) -> list[LoadedTable]:
    """The arm's motions with θ, τ and q multiplied, and zero added to θ and q; one number or one a joint."""
    return [
        ((), GroupTable(f"g{i}", "t", "none", d.time, d.theta * theta + zero, d.tau * tau, d.q * q + zero))
        for i, d in enumerate(arm()[1])
    ]


def found(groups: Sequence[LoadedTable], **keys: Any) -> list[Issue]:
    return check_groups(mapping_of(JOINTS, **keys), arm()[0], groups)


def test_good_data_raise_none(demo: MeasurementSet) -> None:
    assert found(tables()) == []
    groups = [(g.bodies, GroupTable.of(g)) for g in demo.groups]
    assert check_groups(mapping_of(demo.joints), demo.robot, groups) == []


one, other = np.array([-1.0, 1.0]), np.array([1.0, -1.0])
FAULTS: dict[str, tuple[dict[str, Any], dict[str, Any], set[tuple[str, str, str, Any]]]] = {
    # what is done to the data; what the mapping says; the fixes (joint, signal, key, value)
    "theta in degrees": (
        {"theta": 1 / DEGREE, "q": 1 / DEGREE},
        {},
        {(j, "theta", "unit", "deg") for j in JOINTS},
    ),
    "one theta in degrees": ({"theta": [1.0, 1 / DEGREE]}, {}, {("joint2", "theta", "unit", "deg")}),
    "q in degrees": ({"q": 1 / DEGREE}, {}, {(j, "q", "unit", "deg") for j in JOINTS}),
    "theta before the gear": (
        {"theta": 100.0},
        {"gear": 100.0},
        {(j, "theta", "side", "motor") for j in JOINTS},
    ),
    "tau before the gear": ({"tau": 0.01}, {"gear": 100.0}, {(j, "tau", "side", "motor") for j in JOINTS}),
    "tau in mNm": ({"tau": 1e3}, {}, {(j, "tau", "unit", "mNm") for j in JOINTS}),
    "a current": ({"tau": 1 / 9.0}, {"torque_constant": 9.0}, {(j, "tau", "unit", "A") for j in JOINTS}),
    "tau turned round": ({"tau": one}, {}, {("joint1", "tau", "sign", -1)}),
    "all tau turned round": ({"tau": -1.0}, {}, {(j, "tau", "sign", -1) for j in JOINTS}),
    "theta turned round": ({"theta": other, "q": other}, {}, {("joint2", "theta", "sign", -1)}),
    "q turned round": ({"q": other}, {}, {("joint2", "q", "sign", -1)}),
    "a joint turned round": (
        {"theta": other, "tau": other, "q": other},
        {},
        {("joint2", "theta", "sign", -1), ("joint2", "tau", "sign", -1)},
    ),
    "another zero": ({"zero": [0.0, np.pi / 2]}, {}, {("joint2", "theta", "offset", -1.570796)}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_named_and_undone(fault: str) -> None:
    changes, keys, expected = FAULTS[fault]
    changes = {name: np.array(value) if isinstance(value, list) else value for name, value in changes.items()}
    issues = found(tables(**changes), **keys)
    fixes = {(f.joint, f.signal, f.key, f.value) for s in issues for f in s.fixes}
    assert fixes == expected, [issue_text(s) for s in issues]
    severity = "odd" if fault == "another zero" else "wrong"
    assert {s.severity for s in issues} == {severity}
    mapping = with_fixes(mapping_of(JOINTS, **keys), tuple(f for s in issues for f in s.fixes))
    joint, signal, key, value = next(iter(expected))
    assert getattr(getattr(mapping.joints[joint], signal), key) == value


def test_gears_that_are_stated_and_not_used_are_one_issue() -> None:
    """Also where motor and joint turn opposite ways, and without q."""
    groups = [(bodies, replace(t, q=None)) for bodies, t in tables(theta=-80.0, tau=-1 / 80.0)]
    (issue,) = found(groups, gear=-80.0)
    assert (issue.severity, issue.joints, issue.signal) == ("wrong", JOINTS, "theta and tau")
    assert {(f.joint, f.signal, f.key, f.value) for f in issue.fixes} == {
        (joint, signal, "side", "motor") for joint in JOINTS for signal in ("theta", "tau")
    }
    assert "their gears are stated, but not used" in issue_message(issue)
    used = with_fixes(mapping_of(JOINTS, gear=-80.0), issue.fixes)
    assert check_groups(used, arm()[0], [(b, replace(t, q=None)) for b, t in tables()]) == []
    assert found([(b, replace(t, q=None)) for b, t in tables()], gear=-80.0) == []  # behind the gears already
    turned = [(b, replace(t, theta=t.theta * [1.0, 0.0], q=None)) for b, t in tables(tau=one)]
    issues = found(turned, gear=100.0)  # a joint at rest says nothing of its gear
    assert issues and all(s.signal == "tau" and "not used" not in issue_message(s) for s in issues)
    slow = [
        (b, replace(t, tau=0.1 * t.tau + 3.0 * np.sign(np.gradient(t.theta, axis=0)), q=None))
        for b, t in tables()
    ]
    assert all(
        "not used" not in issue_message(s) for s in found(slow, gear=100.0)
    )  # friction explains it either way


@pytest.mark.parametrize(("signals", "exchanged"), [("tau", ("tau",)), ("theta and tau", ("theta", "tau"))])
def test_exchanged_joints(signals: str, exchanged: tuple[str, ...]) -> None:
    """Told instead of what else would explain a little more of their torques."""
    turned = [
        (bodies, replace(t, q=None, **{name: getattr(t, name)[:, ::-1] for name in exchanged}))
        for bodies, t in tables()
    ]
    (issue,) = found(turned)
    assert (issue.kind, issue.severity, issue.signal) == ("order", "wrong", signals)
    assert issue.joints == JOINTS and not issue.fixes
    assert issue_message(issue).startswith(
        "with the columns of joint1 and joint2 exchanged the robot's masses explain"
    )


def test_current_without_a_constant_is_named_by_its_size() -> None:
    (issue,) = found(tables(tau=1 / 9.0))
    assert issue.severity == "wrong" and issue.joints == JOINTS and not issue.fixes
    assert 'a current (unit = "A", torque_constant), or before a gear' in issue_message(issue)
    (issue,) = found(tables(tau=1 / 900.0), gear=90.0)
    numbers = issue_message(issue).split("torque_constant about ")[1].split(" Nm/A")[0].split(", ")
    assert [float(number) for number in numbers] == pytest.approx([10.0, 10.0], rel=0.3)


def test_gear_that_nobody_named() -> None:
    issues = found(tables(theta=100.0))
    assert [(s.joints, s.signal, s.severity) for s in issues] == [(JOINTS, "theta", "wrong")]
    assert issues[0].values["times_q"] == pytest.approx(dict.fromkeys(JOINTS, 100.0), rel=0.02)
    (issue,) = found([(bodies, replace(t, q=None)) for bodies, t in tables(theta=300.0)])
    assert (issue.joints, issue.signal, issue.severity) == (JOINTS, "theta", "wrong")
    assert issue.values["gears"] == pytest.approx(dict.fromkeys(JOINTS, 300.0), rel=0.25)


def test_positions_in_no_known_unit() -> None:
    (issue,) = found([(bodies, replace(t, q=None)) for bodies, t in tables(theta=1 / 0.005)])
    assert issue.signal == "theta" and issue.severity == "wrong" and not issue.fixes
    assert issue.values["unit_sizes"] == pytest.approx(dict.fromkeys(JOINTS, 0.005), rel=0.25)


def test_positions_in_per_cent_of_a_range_are_no_degrees() -> None:
    sizes = (arm()[0].upper_limit - arm()[0].lower_limit) / 200
    (issue,) = found([(bodies, replace(t, q=None)) for bodies, t in tables(theta=1 / sizes)])
    assert issue.severity == "wrong" and issue.values["per_cent"]
    assert [fix.value for fix in issue.fixes if fix.key == "unit"] == pytest.approx(list(sizes), rel=1e-4)


def test_torques_without_their_sign() -> None:
    (issue,) = found([(bodies, replace(t, tau=np.abs(t.tau))) for bodies, t in tables()])
    assert (issue.kind, issue.severity, issue.joints) == ("magnitude", "wrong", JOINTS)
    assert not issue.fixes and issue.values["explained"] > 0.9


def test_a_wrong_sign_beside_a_wrong_zero_is_that_of_tau() -> None:
    """A turned round θ of joint 1 would explain nearly as much."""
    issues = found(tables(tau=one, zero=np.array([0.0, np.pi])))
    fixes = {(f.joint, f.signal, f.key, f.value) for s in issues for f in s.fixes}
    assert fixes == {("joint1", "tau", "sign", -1), ("joint2", "theta", "offset", 3.141593)}


def with_motor_friction(drive: Any, size: float, *, theta_too: bool = False, tau: bool = True) -> list[Any]:
    """The arm's motions with friction of the motors that `drive` couples to the joints; τ of the motors."""
    drive = np.array(drive, dtype=float)
    groups = []
    for (_, table), data in zip(tables(), arm()[1], strict=True):
        v = np.gradient(data.q, data.time, axis=0)
        motor_v = v @ np.linalg.inv(drive).T
        torque = (table.tau - v) @ drive + motor_v + size * np.tanh(motor_v / 0.01)
        theta = table.theta @ np.linalg.inv(drive).T if theta_too else table.theta
        joint_torque = torque if tau else torque @ np.linalg.inv(drive)
        groups.append(((), replace(table, theta=theta, tau=joint_torque, q=None)))
    return groups


def shown(matrix: Any, signals: str) -> str:
    joints = 'joints = ["joint1", "joint2"]'
    return f'coupling = {{ {joints}, matrix = {matrix} }} and side = "motor" of {signals}'


@pytest.mark.parametrize("theta_too", [False, slow(True)])
@pytest.mark.parametrize("drive", [[[1, 0], [1, 1]], [[1, 0], [-1, 1]]])
def test_a_missing_coupling_is_named(drive: Any, theta_too: bool) -> None:
    """Although friction and inertia explain nearly all of the torque without it."""
    (issue,) = found(with_motor_friction(drive, 2.0, theta_too=theta_too))
    assert issue.kind == "coupling" and issue.severity == "odd" and issue.joints == JOINTS
    assert shown(drive, "theta and tau" if theta_too else "tau") in issue_message(issue)
    assert found(with_motor_friction(drive, 20.0, tau=False)) == []  # converted: only friction is coupled
    little = found(with_motor_friction(drive, 5.0, tau=False))
    assert all(any(other.values.get("converted") for other in issue.alike) for issue in little)


@pytest.mark.parametrize("turns", [0.5, -0.5, 1.0])
def test_another_zero_under_large_friction_is_named(turns: float) -> None:
    """The friction is most of the torque, so that it seems well explained with any zero."""
    groups = with_motor_friction(np.eye(2), 20.0)
    assert found(groups) == []
    moved = [((), replace(t, theta=t.theta + np.array([0.0, turns * np.pi]))) for _, t in groups]
    (issue,) = found(moved)
    assert issue.kind == "zero" and issue.severity == "odd"
    (fix,) = issue.fixes
    assert (fix.joint, fix.key) == ("joint2", "offset")
    assert fix.value == pytest.approx(np.pi if turns == 1.0 else -turns * np.pi, abs=1e-6)


def test_q_of_another_joint_or_another_zero_or_swapped() -> None:
    groups = tables()
    crossed = [((), replace(t, q=t.q[:, ::-1])) for _, t in groups]  # type: ignore[index]
    assert {(s.kind, s.signal) for s in found(crossed)} == {("unexplained", "q")}
    moved = [((), replace(t, q=t.q + 0.5)) for _, t in groups]  # type: ignore[operator]
    assert [(s.kind, s.severity, s.fixes[0].value) for s in found(moved)] == [
        ("zero", "odd", pytest.approx(-0.5, abs=0.02))
    ] * 2
    swapped = [((), replace(t, q=t.theta, theta=t.q)) for _, t in groups]  # type: ignore[arg-type]
    assert {(s.kind, s.severity) for s in found(swapped)} == {("swapped", "odd")}


def test_data_that_prove_nothing_raise_none() -> None:
    """A joint that stands, and a record of a tenth of a second: nothing is known, so nothing is said."""
    standing = np.array([1.0, 0.0])
    assert [issue_text(s) for s in found(tables(theta=standing, q=standing)) if "joint2" in s.joints] == []
    short = [
        ((), GroupTable(t.name, "t", "none", t.time[:50], t.theta[:50], -t.tau[:50])) for _, t in tables()
    ]
    assert found(short) == []


def test_two_faults_at_once() -> None:
    """A current of a motor before its gear, one joint turned round: every part of it is found."""
    factors = np.array([1.0, -1.0])
    groups = tables(theta=100.0 * factors, tau=factors / 100.0 / 0.1, q=1.0)
    issues = found(groups, gear=100.0, torque_constant=0.1)
    fixes = {(f.joint, f.signal, f.key) for s in issues if s.severity == "wrong" for f in s.fixes}
    assert fixes == {
        *((joint, "theta", "side") for joint in JOINTS),
        *((joint, "tau", key) for joint in JOINTS for key in ("unit", "side")),
        *(("joint2", signal, "sign") for signal in ("theta", "tau")),
    }


def test_robot_without_masses_says_nothing_of_torques() -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = write_robot(Path(folder))
        file.write_text(re.sub(r"<inertial>.*?</inertial>", "", file.read_text(), flags=re.DOTALL))
        robot = Robot.load(file, JOINTS)
    assert {s.kind for s in check_groups(mapping_of(JOINTS), robot, tables(tau=-1.0))} == {"swapped"}
    far = check_groups(mapping_of(JOINTS), robot, tables(theta=1 / DEGREE, q=1 / DEGREE))
    assert {s.signal for s in far} == {"theta"}


def delayed(measurements: MeasurementSet, samples: int) -> MeasurementSet:
    """The set with τ stamped so many samples too early, short enough to be quick."""

    def shift(segment: Any) -> Any:
        rows = slice(0, 6000)
        ahead = slice(samples, samples + 6000)
        return replace(segment, time=segment.time[rows], theta=segment.theta[rows], tau=segment.tau[ahead])

    groups = [replace(g, segments=tuple(shift(s) for s in g.segments)) for g in measurements.fit_groups[:2]]
    return replace(measurements, groups=tuple(groups))


def test_delay_of_the_torque(demo: MeasurementSet) -> None:
    """Torque and acceleration that disagree by three samples are pointed out, to 0.05 ms."""
    good = torque_delay(delayed(demo, 0), lambda what: None, lambda: False)
    assert good is not None and abs(good.seconds) < 5e-5 and delay_issues(good, demo) == []
    late = torque_delay(delayed(demo, 3), lambda what: None, lambda: False)
    assert late is not None and late.seconds == pytest.approx(0.003, abs=5e-5) and late.share > 0.99
    (issue,) = delay_issues(late, demo)
    assert issue.kind == "delay" and issue.severity == "odd"
    assert issue.values["samples"] == pytest.approx(3.0, rel=0.2)


def test_the_joint_that_is_explained_least_is_named(demo: MeasurementSet) -> None:
    """The share of all torques together hides a joint of which an unknown torque is 2 %."""

    def spoiled(segment: Any) -> Any:
        swing = np.outer(np.sin(9.0 * segment.time), np.array([0.0, 0.2]) * np.std(segment.tau[:, 1]))
        return replace(segment, tau=segment.tau + swing)

    good = delayed(demo, 0)
    groups = [replace(g, segments=tuple(spoiled(s) for s in g.segments)) for g in good.groups]
    found = torque_delay(replace(good, groups=tuple(groups)), lambda what: None, lambda: False)
    powers = np.mean([np.var(s.tau, axis=0) for g in good.groups for s in g.segments], axis=0)
    assert found is not None and found.share == pytest.approx(1 - 0.02 * powers[1] / powers.sum(), abs=0.002)
    joint, share = found.worst
    assert joint == demo.joints[1] and share == pytest.approx(0.98, abs=0.005)


def test_wrong_is_not_written_unless_insisted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)
    data = arm()[1][0]
    write_robot(tmp_path)
    columns = np.column_stack([data.time, data.theta, -data.tau])
    np.savetxt(tmp_path / "run.csv", columns, delimiter=",", header="t,p1,p2,m1,m2")
    mapping = write_mapping(tmp_path, ["run.csv"], '"p#"', '"m#"', time='column = "t"')
    done = import_logs(mapping, tmp_path / "set")
    assert done.folder is None and done.wrong and not (tmp_path / "set").exists()
    assert import_logs(mapping, tmp_path / "set", accept=True).folder == tmp_path / "set"


PRACTICE = Path(__file__).resolve().parents[3] / "shared" / "practice" / "cases"


def test_a_set_that_never_saw_an_import_is_doubted_all_the_same(
    demo: MeasurementSet, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A torque that is turned round is named with its file, joint and remedy; a sound set raises nothing."""
    assert with_plausibility_warnings(demo) is demo
    groups = tuple(
        replace(g, segments=tuple(replace(s, tau=s.tau * [1.0, -1.0]) for s in g.segments))
        for g in demo.groups
    )
    with caplog.at_level("WARNING"):
        doubted = with_plausibility_warnings(replace(demo, groups=groups, path=tmp_path))
    (fact,) = doubted.warnings
    assert fact.text == caplog.messages[-1] and fact.values["issue"].kind == "sign"
    assert (fact.joints, fact.file) == (("joint2",), f"{tmp_path / 'measurements.toml'}")


def test_a_diagnosis_says_what_its_set_contradicts(
    demo: MeasurementSet, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command warns before it begins to search."""
    folder = shutil.copytree(demo.path, tmp_path / "set")
    for group in demo.groups:
        table = pq.read_table(folder / group.file.name)
        at = table.column_names.index("tau_joint2")
        turned = table.set_column(at, "tau_joint2", pa.array(-table["tau_joint2"].to_numpy()))
        pq.write_table(turned, folder / group.file.name)

    def begun(measurements: MeasurementSet, **_: object) -> None:
        (text,) = caplog.messages
        assert measurements.joints == demo.joints and "tau of joint2: with sign = -1" in text
        raise Cancelled

    monkeypatch.setattr("flexviz.analysis.diagnosis.diagnose", begun)
    options: dict[str, Any] = dict(guard=None, free_curve=False, json_file=None)
    with caplog.at_level("WARNING"), pytest.raises(Cancelled):
        analysis.diagnose(folder, apply=False, decoys=False, **options)


IN_EVERY_RUN = ("2r-coulomb_friction", "2r-none-19", "2r-unknown", "panda-stribeck_friction", "ur5-none-1")


@pytest.mark.skipif(not PRACTICE.is_dir(), reason="the practice cases are not here")
@pytest.mark.parametrize("names", [IN_EVERY_RUN, pytest.param((), id="all", marks=pytest.mark.study)])
def test_hidden_effects_raise_no_doubts(names: tuple[str, ...]) -> None:
    for name in names or sorted(path.name for path in PRACTICE.iterdir()):
        assert not with_plausibility_warnings(read_set(PRACTICE / name)).warnings, name
