"""Measurement sets: reading, segments, resampling, writing; test_bad_measurements.py has what is refused."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from dataclasses import replace
from datetime import UTC
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as papq
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from small_set import URDF, columns, write_small_set, write_table

from flexviz.base import toml
from flexviz.base.errors import InputError
from flexviz.data.measurements import GroupTable, MeasurementSet, overview, read_set, write_set
from flexviz.data.measurements.segments import SHORTEST, make_segments
from flexviz.robot.robot import PayloadBody

SHARED = Path(__file__).resolve().parents[3] / "shared"
CASES = sorted((SHARED / "practice" / "cases").glob("*/measurements.toml"))
KUKA = SHARED / "real" / "kuka_kr300"


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_small_set(tmp_path / "small")


def test_everything_is_read(small: Path) -> None:
    for path in (small, small / "measurements.toml", str(small)):
        measurements = read_set(path)
    assert measurements.name == "small" and measurements.path == small.resolve()
    assert measurements.joints == measurements.robot.joints == ("joint1", "joint2")
    assert measurements.torque_hold == 0.001 and measurements.effects == ("coulomb_friction",)
    np.testing.assert_array_equal(measurements.initial_stiffness, [2000.0, 1500.0])
    np.testing.assert_array_equal(measurements.initial_motor_inertia, [1.5, 1.0])
    np.testing.assert_array_equal(measurements.kp, [10000.0, 6000.0])
    np.testing.assert_array_equal(measurements.kd, [500.0, 250.0])
    assert [g.name for g in measurements.fit_groups] == ["g1", "g2"]
    assert [g.name for g in measurements.validation_groups] == ["g3"]
    assert measurements.payloads["p1"] == () and measurements.payloads["p2"][0].mass == 2.0
    assert not measurements.simulated and not measurements.warnings
    for seed, group in enumerate(measurements.groups):
        expected = columns(seed)
        (segment,) = group.segments
        assert group.samples == len(segment) == 2000 and group.duration == pytest.approx(1999 * 0.002)
        assert segment.step == pytest.approx(0.002, rel=1e-12)
        np.testing.assert_array_equal(segment.time, expected["time"])
        for j in (0, 1):
            np.testing.assert_array_equal(segment.theta[:, j], expected[f"theta_joint{j + 1}"])
            np.testing.assert_array_equal(segment.tau[:, j], expected[f"tau_joint{j + 1}"])
        assert group.q is not None and group.tau_joint is None and group.theta_ref is None
        np.testing.assert_array_equal(group.q[:, 0], expected["q_joint1"])
        assert np.isnan(group.q[:, 1]).all()


def test_truth_is_seen_but_never_read(small: Path) -> None:
    (small / "truth.json").write_text("this is no JSON")
    assert read_set(small).simulated


def test_single_precision_and_integers(small: Path) -> None:
    table = columns(1)
    stored: dict[str, Any] = {name: x.astype(np.float32) for name, x in table.items() if name != "time"}
    stored["tau_joint2"] = np.round(table["tau_joint2"]).astype(np.int32)
    write_table(small / "b.parquet", {"time": table["time"]} | stored)
    segment = read_set(small).group("g2").segments[0]
    assert segment.theta.dtype == segment.tau.dtype == np.float64
    np.testing.assert_array_equal(segment.theta[:, 0], stored["theta_joint1"].astype(float))
    np.testing.assert_array_equal(segment.tau[:, 1], np.round(table["tau_joint2"]))


def test_columns_in_any_order_with_others_between(small: Path) -> None:
    table = columns(0)
    names = sorted(table, reverse=True)
    mixed = {"note": np.arange(2000)} | {name: table[name] for name in names} | {"tau_joint9": table["time"]}
    write_table(small / "a.csv", mixed)
    text = (small / "a.csv").read_text()
    text = text.replace('"', "").replace(",", " , ", 40)
    (small / "a.csv").write_text("\ufeff" + text, encoding="utf-8")
    measurements = read_set(small)
    np.testing.assert_array_equal(measurements.group("g1").segments[0].tau[:, 1], table["tau_joint2"])
    assert [fact.columns for fact in measurements.warnings] == [("tau_joint9",)]


def test_names_that_could_mean_two_things(small: Path) -> None:
    """A joint called joint_1 has tau_joint_1, which is not the joint torque sensor of a joint called 1."""
    toml_text = (small / "measurements.toml").read_text()
    (small / "measurements.toml").write_text(toml_text.replace('"joint1", "joint2"', '"joint_1", "1"'))
    urdf = URDF.replace('"joint1"', '"joint_1"').replace('"joint2"', '"1"')
    (small / "robot.urdf").write_text(urdf)
    for seed, name in enumerate(("a.csv", "b.parquet", "sub/c.csv")):
        table = columns(seed)
        new = {"time": "time", "q_joint1": "q_1", "theta_joint1": "theta_joint_1", "theta_joint2": "theta_1"}
        new |= {"tau_joint1": "tau_joint_1", "tau_joint2": "tau_1"}
        write_table(small / name, {new[key]: value for key, value in table.items()})
    group = read_set(small).groups[0]
    assert group.tau_joint is None
    np.testing.assert_array_equal(group.segments[0].tau[:, 0], columns(0)["tau_joint1"])


# -- choosing groups and samples ---------------------------------------------------------------------


def test_select_groups(small: Path) -> None:
    measurements = read_set(small)
    fit, validation = measurements.select()
    assert [g.name for g in fit] == ["g1", "g2"] and [g.name for g in validation] == ["g3"]
    fit, validation = measurements.select(["g2", "g2"])
    assert [g.name for g in fit] == ["g2"] and [g.name for g in validation] == ["g3"]
    for names, words in ((["g9"], '"g9" does not exist'), (["g3"], "never for fitting"), ([], "no group")):
        with pytest.raises(InputError, match=words) as caught:
            measurements.select(names)
        assert "\n" not in str(caught.value) and str(small) in str(caught.value)
    assert measurements.joint_index("joint2") == 1
    with pytest.raises(InputError, match=r'did you mean "joint2"'):
        measurements.joint_index("joint3")


# -- time: clocks, gaps, jitter ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "time",
    [
        np.arange(5000) * 0.001,
        np.cumsum(np.full(5000, 0.001)),
        np.linspace(0.0, 4999 / 3000, 5000),
        np.arange(5000) * 0.00025 + 1.7e9 / 1e3,
        (np.arange(60000) * 0.001).astype(np.float32).astype(float),
        np.round(np.arange(5000) / 3000, 4),
        np.round(np.arange(5000) * 0.0015, 3),
        np.arange(5000) * 0.001 + np.random.default_rng(0).uniform(-9e-7, 9e-7, 5000),
    ],
    ids=["exact", "summed", "thirds", "offset", "float32", "4 decimals", "3 decimals", "0.09 %"],
)
def test_rounding_is_no_jitter(time: np.ndarray) -> None:
    signals = np.random.default_rng(1).normal(size=(len(time), 2))
    found = make_segments(time, signals.copy(), 1)
    (segment,) = found.segments
    assert not found.jitters and found.dropped == found.filled == 0
    np.testing.assert_array_equal(segment.theta, signals[:, :1])
    assert np.ptp(np.diff(segment.time)) <= 4 * np.spacing(time[-1])


# -- writing -----------------------------------------------------------------------------------------


def copy_set(measurements: MeasurementSet, folder: Path, table_format: str) -> Path:
    """Write a set that was read to another folder."""
    return write_set(
        folder,
        robot="robot.urdf",
        joints=measurements.joints,
        groups=[replace(GroupTable.of(group), file=None) for group in measurements.groups],
        payloads=measurements.payloads,
        torque_hold=measurements.torque_hold,
        initial_stiffness=measurements.initial_stiffness,
        kp=measurements.kp,
        kd=measurements.kd,
        effects=measurements.effects,
        files={"robot.urdf": measurements.robot.urdf_path},
        table_format=table_format,
    )


@pytest.mark.parametrize("table_format", ["csv", "parquet"])
def test_copy_gives_the_same_set(small: Path, tmp_path: Path, table_format: str) -> None:
    first = read_set(small)
    second = read_set(copy_set(first, tmp_path / "deep" / "copy", table_format))
    assert second.joints == first.joints and second.effects == first.effects
    assert second.torque_hold == first.torque_hold
    np.testing.assert_array_equal(second.kp, first.kp)
    np.testing.assert_array_equal(second.initial_stiffness, first.initial_stiffness)
    np.testing.assert_array_equal(second.payloads["p2"][0].inertia, first.payloads["p2"][0].inertia)
    assert second.payloads["p2"][0].link == "link2"
    for a, b in zip(first.groups, second.groups, strict=True):
        assert (a.name, a.trajectory, a.payload, a.validation) == (
            b.name,
            b.trajectory,
            b.payload,
            b.validation,
        )
        for name in ("time", "theta", "tau"):
            np.testing.assert_array_equal(getattr(a.segments[0], name), getattr(b.segments[0], name))
        np.testing.assert_array_equal(a.q, b.q)
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["copy"]


def test_a_folder_above_can_be_written_to(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    folder = copy_set(read_set(small), Path("../x"), "parquet")
    assert folder == tmp_path / "x" and read_set(folder).groups


SMALL = st.floats(-1e-3, 1e-3, allow_subnormal=True)  # a motion that no unit check minds
MASSLESS = URDF.replace('mass value="4"', 'mass value="0"').replace('"0.1"', '"0"')


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_round_trip_is_exact(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    rows = data.draw(st.integers(SHORTEST, 60))
    signal = hnp.arrays(np.float64, (rows, 2), elements=SMALL)
    step = data.draw(st.sampled_from([0.00025, 0.001, 1 / 300, 0.025]))
    time = data.draw(st.floats(0, 1e3)) + step * np.arange(rows)
    single = data.draw(st.booleans())
    theta, tau = data.draw(signal), data.draw(signal)
    assume(
        all(np.ptp(part.astype(np.float32)) > 0 for part in (theta, tau))
    )  # a set without motion is refused
    name = data.draw(st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), min_size=1, max_size=8))
    table_format = data.draw(st.sampled_from(["csv", "parquet"]))
    gains = data.draw(st.lists(st.floats(1e-9, 1e9), min_size=2, max_size=2))
    date = data.draw(st.none() | st.dates() | st.datetimes(timezones=st.none() | st.just(UTC)))
    body = PayloadBody("link2", 1.5, np.array([0.1, -0.2, 0.3]), np.array([1e-3, 1e-3, 1.5e-3, 1e-5, 0, 0]))
    folder = tmp_path_factory.mktemp("round")
    file = f"sub/x.{table_format}"
    table = GroupTable(name, name, name, time, theta, tau, theta_ref=theta, validation=True, file=file)
    write_set(
        folder,
        robot="robot.urdf",
        joints=["joint1", "joint2"],
        groups=[table],
        payloads={name: [body]},
        kp=gains,
        kd=gains,
        files={"robot.urdf": MASSLESS, "truth.json": b"{}"},
        table_format=table_format,
        single=single,
        date=date,
    )
    try:
        measurements = read_set(folder)
    except InputError as error:  # drawn torques that resemble those of the payload in another unit
        assume("the torque of the rigid model" not in str(error))
        raise
    assert measurements.date == overview(folder).date == date
    assert overview(folder).files == measurements.files_read
    (group,) = measurements.groups
    assert group.name == group.payload == name and group.validation and measurements.simulated
    kind = np.float32 if single else np.float64
    np.testing.assert_array_equal(group.time, time)
    np.testing.assert_array_equal(group.segments[0].theta, theta.astype(kind))
    np.testing.assert_array_equal(group.segments[0].tau, tau.astype(kind))
    np.testing.assert_array_equal(group.theta_ref, theta.astype(kind))
    np.testing.assert_array_equal(measurements.kd, gains)
    np.testing.assert_array_equal(measurements.payloads[name][0].com, body.com)


def test_writing_is_all_or_nothing(small: Path, tmp_path: Path) -> None:
    measurements = read_set(small)
    group = GroupTable.of(measurements.groups[0])
    common = {
        "robot": "robot.urdf",
        "joints": ["joint1", "joint2"],
        "payloads": {"p1": ()},
        "files": {"robot.urdf": URDF},
    }
    target = tmp_path / "new"
    bad: list[dict[str, Any]] = [
        {"files": {"../evil": "x"}},
        {"payloads": {}},
        {"kp": [1.0], "kd": [1.0, 2.0]},
        {"joints": ["joint1"]},
        {"table_format": "xls"},
        {"effects": ["magic"]},
        {"groups": [group, group]},
        {"torque_hold": -1.0},
    ]
    for wrong in bad:
        with pytest.raises(InputError) as caught:
            arguments: dict[str, Any] = {"groups": [group]} | common | wrong
            write_set(target, **arguments)
        assert "\n" not in str(caught.value)
        assert not target.exists() and sorted(p.name for p in tmp_path.iterdir()) == ["small"]
    write_set(target, groups=[group], **common)
    with pytest.raises(InputError, match="already there"):
        write_set(target, groups=[group], **common)
    write_set(target, groups=[group], overwrite=True, **common)
    assert len(read_set(target).groups) == 1
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "precious.txt").write_text("keep me")
    (tmp_path / "file").write_text("keep me too")
    for name in ("other", "file"):
        with pytest.raises(InputError, match="expected a new"):
            write_set(tmp_path / name, groups=[group], overwrite=True, **common)
    assert (tmp_path / "other" / "precious.txt").read_text() == "keep me"


def test_toml_text() -> None:
    document = {
        "a b": 'x"y\\z\n\u007f',
        "n": 1,
        "x": 1e-300,
        "on": True,
        "list": [1.0, 2.5],
        "t": {"u": {"v": []}},
    }
    assert tomllib.loads(toml.dumps(document)) == document


# -- real input --------------------------------------------------------------------------------------


@pytest.mark.skipif(not CASES, reason="the practice cases are not here")
@pytest.mark.parametrize("case", CASES, ids=lambda path: path.parent.name)
def test_practice_cases(case: Path) -> None:
    measurements = read_set(case)
    assert not measurements.warnings
    assert [len(g.segments) for g in measurements.groups] == [1, 1, 1, 1]
    assert all(g.samples == 12000 and g.segments[0].step == pytest.approx(0.001) for g in measurements.groups)


@pytest.mark.skipif(not KUKA.is_dir(), reason="the recorded KUKA set is not here")
def test_recorded_kuka() -> None:
    measurements = read_set(KUKA)
    assert not measurements.warnings and measurements.n == 6
    assert [g.samples for g in measurements.groups] == [2501, 2501]
    group = measurements.groups[0]
    assert group.q is not None and group.theta_ref is not None
    assert np.isfinite(group.q[:, :3]).all() and np.isnan(group.q[:, 3:]).all()


@pytest.mark.slow
def test_large_set_is_not_copied() -> None:
    """15 minutes at 1 kHz with 7 joints: memory stays near that of the arrays (libraries take 80 MB)."""
    command = [sys.executable, "-m", "benchmarks.load", "--hours", "0.25", "--formats", "parquet,csv"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    for line in result.stdout.splitlines()[1:]:
        ratio = float(line.split("peak/arrays")[1].split()[0])
        assert ratio < 2.8, result.stdout


def test_parquet_with_several_row_groups(small: Path) -> None:
    table = columns(1)
    papq.write_table(pa.table(table), small / "b.parquet", row_group_size=333)
    segment = read_set(small).group("g2").segments[0]
    np.testing.assert_array_equal(segment.theta[:, 1], table["theta_joint2"])
    assert segment.theta.flags.f_contiguous or segment.theta.T.flags.c_contiguous


def test_quoted_csv(small: Path) -> None:
    pacsv.write_csv(pa.table(columns(0)), small / "a.csv", pacsv.WriteOptions(quoting_style="all_valid"))
    assert read_set(small).group("g1").samples == 2000
