"""Jitter, missing samples and gaps: resampled, filled, split, and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_set import columns, write_small_set, write_table

from flexviz.measurements import read_set
from flexviz.measurements.segments import find_clock, make_segments, pieces


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_small_set(tmp_path / "small")


@pytest.mark.parametrize("kind", ["jitter", "lost samples", "both", "two speeds"])
@pytest.mark.parametrize("rows", [100, 20000, 150000])
def test_jitter_is_resampled(kind: str, rows: int) -> None:
    rng = np.random.default_rng(2)
    time = 0.001 * np.arange(rows)
    if kind == "two speeds":
        time[rows // 2 :] += 0.0009 * np.arange(rows - rows // 2)
    if kind in ("jitter", "both"):
        time = time + rng.uniform(-3e-4, 3e-4, rows)
    if kind in ("lost samples", "both"):
        lost = 2 + 3 * rng.choice(rows // 3 - 2, rows // 20, replace=False)  # never two in a row
        time = np.delete(time, lost)

    def signal(t: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(20 * t), np.cos(33 * t), t / time[-1], 5 * np.sin(7 * t)], axis=1)

    found = make_segments(time, signal(time), 2)
    assert found.jitters == (kind != "lost samples") and found.dropped == 0 and len(found.segments) == 1
    if kind in ("jitter", "lost samples"):
        assert found.filled == (rows // 20 if kind == "lost samples" else 0)
    (segment,) = found.segments
    assert segment.time[0] >= time[0] and segment.time[-1] <= time[-1] + 1e-9
    np.testing.assert_allclose(np.diff(segment.time), segment.step, rtol=1e-6)
    np.testing.assert_allclose(np.hstack([segment.theta, segment.tau]), signal(segment.time), atol=2e-6)


def test_gaps_split(small: Path) -> None:
    table = columns(0)
    keep = np.ones(2000, dtype=bool)
    keep[500:600] = keep[1500:1510] = False
    keep[620:660] = False  # leaves 20 samples between two gaps: too few
    write_table(small / "a.csv", {name: x[keep] for name, x in table.items()})
    measurements = read_set(small)
    group = measurements.group("g1")
    assert [len(s) for s in group.segments] == [500, 840, 490]
    assert group.segments[1].time[0] == pytest.approx(660 * 0.002)
    np.testing.assert_array_equal(group.segments[2].theta[:, 1], table["theta_joint2"][1510:])
    assert "20 samples" in measurements.warnings[0]
    assert len(group.time) == 1850 and group.q is not None and len(group.q) == 1850
    q = group.at("q", group.segments[1].time)
    assert q is not None
    np.testing.assert_allclose(q[:, 0], table["q_joint1"][660:1500], atol=1e-9)
    assert group.at("tau_joint", group.time) is None


def test_one_lost_sample_is_no_gap() -> None:
    time = np.delete(0.01 * np.arange(200), 77)
    assert len(pieces(time)) == 1
    clock = find_clock(time)
    assert clock.count == 200 and clock.step == pytest.approx(0.01)


def test_jitter_in_a_file_is_told(small: Path) -> None:
    table = columns(0)
    time = table["time"] + np.random.default_rng(0).uniform(-4e-4, 4e-4, 2000)
    exact = columns(0)
    table["time"] = np.sort(time)
    for name in table:
        if name != "time":
            table[name] = np.interp(table["time"], exact["time"], exact[name])
    write_table(small / "a.csv", table)
    measurements = read_set(small)
    segment = measurements.group("g1").segments[0]
    assert "jitters" in measurements.warnings[0]
    theta = np.interp(segment.time, exact["time"], exact["theta_joint1"])
    np.testing.assert_allclose(segment.theta[:, 0], theta, atol=3e-4)


def test_what_was_done_to_the_clocks_is_said_once(small: Path) -> None:
    """Samples missed one at a time are filled where they were, and all files share one warning."""
    table = columns(0)
    for name in ("a.csv", "sub/c.csv"):
        write_table(small / name, {key: np.delete(x, [700, 1200]) for key, x in table.items()})
    measurements = read_set(small)
    first = f"{small / 'a.csv'} and 1 more: "
    assert measurements.warnings == (f"{first}4 single missing samples were interpolated",)
    (segment,) = measurements.group("g1").segments
    assert len(segment) == 2000
    np.testing.assert_allclose(segment.theta[:, 0], table["theta_joint1"], atol=2e-4)
    for i, name in enumerate(("a.csv", "sub/c.csv")):
        time = table["time"] + np.random.default_rng(i).uniform(-4e-4, 4e-4, 2000)
        write_table(small / name, table | {"time": time})
    (text,) = read_set(small).warnings
    assert text.startswith(f"{first}the time jitters")
