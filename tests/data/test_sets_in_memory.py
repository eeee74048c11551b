"""Sets in memory are written, kept in sessions and reported like those that were read from files."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexviz
from benchmarks.static_stiffness import add_pushes, make_case
from flexviz.data.measurements import GroupTable, MeasurementSet
from tests.small_set import write_small_set

PROPERTIES = ("joints", "torque_hold", "effects", "date", "torque", "rigid", "no_torque", "simulated")
NUMBERS = ("initial_stiffness", "initial_motor_inertia", "kp", "kd")


def alike(a: Any, b: Any, exact: bool) -> bool:
    if a is None or b is None:
        return a is b
    close = np.array_equal if exact else np.allclose
    return bool(close(np.asarray(a, float), np.asarray(b, float), equal_nan=True))


def told(bodies: Any) -> list[Any]:
    return [(b.link, b.mass, b.com.tolist(), b.inertia.tolist()) for b in bodies]


def check_same(found: MeasurementSet, expected: MeasurementSet, exact: bool = True) -> None:
    for name in PROPERTIES:
        assert getattr(found, name) == getattr(expected, name), name
    both = ({name: told(bodies) for name, bodies in one.payloads.items()} for one in (found, expected))
    assert next(both) == next(both)
    for name in NUMBERS:
        assert alike(getattr(found, name), getattr(expected, name), exact), name
    assert found.robot.gravity == expected.robot.gravity and found.robot.urdf == expected.robot.urdf
    for a, b in zip(found.groups, expected.groups, strict=True):
        for name in ("name", "trajectory", "payload", "validation"):
            assert getattr(a, name) == getattr(b, name)
        assert told(a.bodies) == told(b.bodies)
        assert alike(a.temperature, b.temperature, exact)
        for one, other in zip(a.segments, b.segments, strict=True):
            for name in ("time", "theta", "tau", "step"):
                assert alike(getattr(one, name), getattr(other, name), exact), name
            for name in ("q", "tau_joint", "theta_ref"):
                assert alike(a.at(name, other.time), b.at(name, other.time), exact), name
    for a, b in zip(found.holds, expected.holds, strict=True):
        assert (a.name, a.payload, told(a.bodies)) == (b.name, b.payload, told(b.bodies))
        assert a.clamped.tolist() == b.clamped.tolist()
        for name in ("time", "theta", "tau", "approach"):
            assert alike(getattr(a.holds, name), getattr(b.holds, name), True), name


def arrays_of(demo: MeasurementSet, **properties: Any) -> MeasurementSet:
    """The demo as a program has it that records itself, with all that a set can say."""
    runs = {}
    for group in demo.groups[:2]:
        one = group.segments[0]
        runs[group.name] = {"time": one.time, "theta": one.theta, "tau": one.tau, "q": one.theta + 0.001}
    body = flexviz.PayloadBody("link2", 0.8, (0.8, 0.0, 0.0), (0.004, 0.004, 0.004, 0.0, 0.0, 0.0))
    return MeasurementSet.from_arrays(
        "robots:planar_2r", runs, name="mine", validation="t2p2", payloads={"p2": [body]},
        carried={"t2p2": "p2"}, initial_stiffness=[900.0, 1000.0], kp=[1e4, 1e4], kd=[1e2, 1e2],
        date=dt.date(2026, 3, 1), torque="motor", effects="coulomb_friction", torque_hold=0.001, **properties,
    )  # fmt: skip


@pytest.fixture
def mine(demo: MeasurementSet) -> MeasurementSet:
    return arrays_of(demo)


# -- written and read back -----------------------------------------------------------------------------------


@pytest.mark.parametrize("table_format", ["parquet", "csv"])
def test_a_set_of_arrays_is_read_back(mine: MeasurementSet, tmp_path: Path, table_format: str) -> None:
    folder = flexviz.write_set(tmp_path / "set", mine, table_format=table_format)
    assert sorted(file.suffix for file in folder.iterdir()) == sorted([".toml", *2 * [f".{table_format}"]])
    found = flexviz.read_set(folder)
    check_same(found, mine)
    assert not found.warnings and found.in_files and not mine.in_files


def test_a_set_that_was_read_is_written_with_what_was_changed(tmp_path: Path) -> None:
    small = flexviz.read_set(write_small_set(tmp_path / "small"))
    changed = replace(small, effects=("backlash",), groups=small.groups[:2])
    shutil.rmtree(small.path)  # all of it is in memory
    found = flexviz.read_set(flexviz.write_set(tmp_path / "again", changed))
    check_same(found, changed)
    assert found.robot.source == "robot.urdf" and (found.path / "robot.urdf").is_file()


def test_the_demo_stays_a_simulated_set(demo: MeasurementSet, tmp_path: Path) -> None:
    found = flexviz.read_set(flexviz.write_set(tmp_path / "demo", demo))
    check_same(found, demo)
    assert found.simulated and found.files_read is not None


def test_another_mounting_and_a_robot_without_signal_are_kept(demo: MeasurementSet, tmp_path: Path) -> None:
    wall = arrays_of(demo, gravity=(0.0, 9.81, 0.0), no_torque="joint2", rigid="joint1")
    check_same(flexviz.read_set(flexviz.write_set(tmp_path / "wall", wall)), wall)


def test_gaps_and_uneven_clocks_are_written_as_they_are_used(demo: MeasurementSet, tmp_path: Path) -> None:
    one = demo.groups[0].segments[0]
    shift = np.random.default_rng(1).uniform(-0.3, 0.3, len(one)) * one.step
    kept = np.r_[0:4000, 6000 : len(one)]
    time = one.time + shift
    run = {"time": time[kept], "theta": one.theta[kept], "tau": one.tau[kept]}
    uneven = MeasurementSet.from_arrays("robots:planar_2r", run)
    assert len(uneven.groups[0].segments) == 2
    found = flexviz.read_set(flexviz.write_set(tmp_path / "set", uneven))
    check_same(found, uneven, exact=False)


def test_static_tests_are_copied(tmp_path: Path) -> None:
    truth = make_case(51, "none", "ur5", tmp_path / "arm", duration=6.0)
    add_pushes(tmp_path / "arm", truth, np.random.default_rng(51))
    arm = flexviz.read_set(tmp_path / "arm")
    found = flexviz.read_set(flexviz.write_set(tmp_path / "again", arm))
    assert len(arm.holds) > 0
    check_same(found, arm)
    arm.holds[0].file.write_bytes(b"other")
    with pytest.raises(flexviz.InputError, match="changed since the set was read"):
        flexviz.write_set(tmp_path / "third", arm)
    assert not (tmp_path / "third").exists()


def test_what_cannot_be_written_is_refused(mine: MeasurementSet, tmp_path: Path) -> None:
    folder = flexviz.write_set(tmp_path / "set", mine)
    with pytest.raises(flexviz.InputError, match="a measurement set is already there"):
        flexviz.write_set(folder, mine)
    flexviz.write_set(folder, mine, overwrite=True)
    with pytest.raises(flexviz.InputError, match=r"found a set and joints, kp, expected those of the set"):
        flexviz.write_set(tmp_path / "x", mine, joints="joint1", kp=[1.0, 1.0])
    with pytest.raises(flexviz.InputError, match="expected a measurement set, or robot, joints, groups"):
        flexviz.write_set(tmp_path / "x", robot="robots:planar_2r")
    tables = [GroupTable.of(group) for group in mine.groups]  # parts alone, as before
    parts: Any = {"robot": "robots:planar_2r", "joints": mine.joints, "groups": tables}
    flexviz.write_set(tmp_path / "parts", **parts, payloads=mine.payloads)


# -- sessions and reports ------------------------------------------------------------------------------------


def with_fit(opened: flexviz.Session, result: flexviz.Identification) -> flexviz.Session:
    analysis = opened.session.analysis
    done = opened.session.then("identified", analysis.with_identification(result, analysis.settings))
    return replace(opened, session=done)


def test_a_session_of_arrays_carries_its_set(
    mine: MeasurementSet, demo: MeasurementSet, tmp_path: Path
) -> None:
    opened = flexviz.Session.open(mine)
    with pytest.raises(flexviz.InputError, match='the set "mine" is in memory, expected a folder'):
        opened.save()
    result = flexviz.identify(mine, refine=False)
    opened = with_fit(opened, result)
    folder = opened.save(tmp_path / "kept")
    again = flexviz.Session.open(folder)
    check_same(again.measurements, mine)
    assert again.changed == () and again.session.analysis.up_to_date
    kept = again.session.analysis.identification
    assert kept is not None and [p.value for p in kept.parameters] == [p.value for p in result.parameters]
    noted = replace(opened, session=opened.session.with_note("warm"))
    noted.save(folder)  # again, from memory
    assert [note.text for note in flexviz.Session.open(folder).session.notes] == ["warm"]
    moved = folder.rename(tmp_path / "moved")
    assert flexviz.Session.open(moved).session.analysis.up_to_date
    with pytest.raises(flexviz.InputError, match="holds a session of other data"):
        flexviz.Session.open(replace(mine, groups=mine.groups[:1])).save(moved)


@pytest.mark.parametrize("kind", ["html", "md", "json"])
def test_a_fit_in_memory_is_reported(mine: MeasurementSet, tmp_path: Path, kind: str) -> None:
    opened = with_fit(flexviz.Session.open(mine), flexviz.identify(mine, refine=False))
    written = flexviz.write_report(opened, tmp_path / f"report.{kind}", should_stop=lambda: True)
    text = written.file.read_text(encoding="utf-8")
    if kind == "json":
        assert json.loads(text)["set"]["name"] == "mine"
    else:
        assert "in memory" in text and "read_set" not in text and "sha256sum" not in text


def test_arrays_are_diagnosed_reported_and_kept(mine: MeasurementSet, tmp_path: Path) -> None:
    out, kept = str(tmp_path / "report.md"), str(tmp_path / "kept")
    written = flexviz.write_report(mine, out, keep=kept)
    assert written.session.analysis.diagnosis is not None
    assert f"flexviz report {kept} --out report.html" in Path(out).read_text(encoding="utf-8")
    opened = flexviz.Session.open(kept)
    assert opened.changed == () and opened.session.analysis.diagnosis is not None
    check_same(opened.measurements, mine)
