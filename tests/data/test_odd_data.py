"""Unusual robots, data and folders: each ends in a result or in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis import check_bandwidth, diagnose
from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.base.files import whole_folder
from flexviz.content.session import Session, save_session
from flexviz.data.measurements import GroupTable, MeasurementSet, read_set, write_set
from flexviz.model.equation import layout_of
from flexviz.outlets.recording import record_set
from flexviz.outlets.terminal.terminal import write_json
from tests.robot.test_bad_robots import chain
from tests.small_set import columns, write_small_set, write_table

JOINTS = 30


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return read_set(write_small_set(tmp_path_factory.mktemp("odd") / "small"))


@pytest.mark.slow
def test_thirty_joints(tmp_path: Path) -> None:
    names = [f"joint{i + 1}" for i in range(JOINTS)]
    time = np.arange(0.0, 4.0, 0.01)
    theta = 0.05 * np.sin(time[:, None] * np.linspace(2.0, 5.0, JOINTS))
    rng = np.random.default_rng(1)
    tau = 4000.0 * theta + rng.normal(0.0, 1.0, theta.shape)
    group = GroupTable("g1", "t1", "p1", time, theta, tau)
    files = {"robot.urdf": chain(JOINTS)}
    folder = write_set(
        tmp_path / "set", robot="robot.urdf", joints=names, groups=[group], payloads={"p1": []}, files=files
    )
    result = identify(read_set(folder), max_iterations=1, refine=False)
    assert len(result.residual.rms) == JOINTS and np.isfinite(result.residual.rms).all() and result.message


def test_saturated_torque(small: MeasurementSet) -> None:
    """Torque cut off at half its range: a worse fit than that of the whole one, and no failure."""
    fit = [
        identify(with_torque(small, share), max_iterations=3, refine=False).residual.rms
        for share in (1.0, 0.5)
    ]
    assert np.isfinite(fit).all() and (np.array(fit[1]) > np.array(fit[0])).all()


@pytest.mark.parametrize("scale, found", [(1.0, "the position jumps"), (1e-3, "nothing but noise")])
def test_white_noise_is_no_motion(tmp_path: Path, scale: float, found: str) -> None:
    rng, folder = np.random.default_rng(1), write_small_set(tmp_path / "noise")
    for name in ("a.csv", "b.parquet", "sub/c.csv"):
        table = {"time": 0.002 * np.arange(800)}
        for joint in ("joint1", "joint2"):
            table[f"theta_{joint}"] = scale * rng.normal(size=800)
            table[f"tau_{joint}"] = 10.0 * rng.normal(size=800)
        write_table(folder / name, table)
    for command in (identify, diagnose):
        with pytest.raises(InputError, match=found):
            command(read_set(folder))


def test_records_too_short_for_narrow_bands_are_checked_in_the_others(tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "short")
    for seed, name in enumerate(("a.csv", "b.parquet", "sub/c.csv")):
        write_table(folder / name, columns(seed, rows=800))
    measurements = read_set(folder)
    layout = layout_of(measurements)
    check = check_bandwidth(measurements, layout, layout.vector(identify(measurements).model))
    assert 1 < len(check.bandwidths) < 5 and np.isfinite(check.rms).all()


def with_torque(measurements: MeasurementSet, share: float) -> MeasurementSet:
    """The set with every torque cut off at this share of its largest value."""
    groups = []
    for group in measurements.groups:
        segments = []
        for segment in group.segments:
            most = share * np.abs(segment.tau).max(axis=0)
            segments.append(replace(segment, tau=np.clip(segment.tau, -most, most)))
        groups.append(replace(group, segments=tuple(segments)))
    return replace(measurements, groups=tuple(groups))


def test_where_nothing_can_be_written(small: MeasurementSet) -> None:
    """/proc, because root may write into read-only folders."""
    nowhere = Path("/proc/self/fdinfo")
    for write in (
        lambda: write_json(nowhere / "x.json", {}),
        lambda: record_set(small, None, nowhere / "x.rrd"),
        lambda: save_session(Session.of(small), small, nowhere / "session"),
    ):
        with pytest.raises(InputError, match=r"/proc/self/fdinfo/.*: cannot be (written|saved) \("):
            write()
    with pytest.raises(OSError, match="/proc"), whole_folder(nowhere / "set"):
        pass
