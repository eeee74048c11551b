"""Jitter, missing samples and gaps: resampled, filled, split, and told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared_data import REAL
from small_set import columns, write_small_set, write_table

from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.data.importing import import_logs
from flexviz.data.measurements import read_set
from flexviz.data.measurements.segments import find_clock, make_segments, pieces


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
    assert [len(s) for s in group.segments] == [500, 1340]  # the one of 22 ms is bridged
    assert group.segments[1].time[0] == pytest.approx(660 * 0.002)
    np.testing.assert_array_equal(group.segments[1].theta[850:, 1], table["theta_joint2"][1510:])
    np.testing.assert_allclose(group.segments[1].theta[:, 1], table["theta_joint2"][660:], atol=2e-4)
    dropped, bridged = measurements.warnings
    assert dropped.values["count"] == 20 and (bridged.values["count"], bridged.values["left"]) == (1, 2)
    assert bridged.values["longest"] == pytest.approx(0.022)
    assert bridged.values["longest_left"] == pytest.approx(0.202)
    assert len(group.time) == 1850 and group.q is not None and len(group.q) == 1850
    q = group.at("q", group.segments[1].time)
    assert q is not None
    np.testing.assert_allclose(q[:840, 0], table["q_joint1"][660:1500], atol=1e-9)
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
    assert measurements.warnings[0].kind == "time-jitters"
    theta = np.interp(segment.time, exact["time"], exact["theta_joint1"])
    np.testing.assert_allclose(segment.theta[:, 0], theta, atol=3e-4)


def test_what_was_done_to_the_clocks_is_said_once(small: Path) -> None:
    """Samples missed one at a time are filled where they were, and all files share one warning."""
    table = columns(0)
    for name in ("a.csv", "sub/c.csv"):
        write_table(small / name, {key: np.delete(x, [700, 1200]) for key, x in table.items()})
    measurements = read_set(small)
    files = (str(small / "a.csv"), str(small / "sub/c.csv"))
    copies, filled = measurements.warnings
    assert copies.kind == "same-samples" and filled.values == {"files": files, "count": 4}
    assert filled.text == f"{files[0]} and 1 more: 4 single missing samples were interpolated"
    (segment,) = measurements.group("g1").segments
    assert len(segment) == 2000
    np.testing.assert_allclose(segment.theta[:, 0], table["theta_joint1"], atol=2e-4)
    for i, name in enumerate(("a.csv", "sub/c.csv")):
        time = table["time"] + np.random.default_rng(i).uniform(-4e-4, 4e-4, 2000)
        write_table(small / name, table | {"time": time})
    (jitters,) = read_set(small).warnings
    assert jitters.kind == "time-jitters" and jitters.values["files"] == files


# -- late cycles ---------------------------------------------------------------------------------------------


def late(rows: int, every: int, missing: int, hertz: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Time and four signals of content up to `hertz`, with a gap after `every` rows."""
    time = 0.002 * np.arange(rows)
    phase = 2 * np.pi * time[:, None] * hertz * np.array([1.0, 0.7, 0.9, 0.4]) + np.arange(4)
    signals = np.sin(phase) + noise * np.random.default_rng(3).normal(size=phase.shape)
    kept = np.arange(rows) % every >= missing
    return time[kept], signals[kept]


@pytest.mark.parametrize("missing, hertz, noise", [(3, 4.0, 1e-3), (5, 2.0, 1e-4), (10, 1.0, 1e-3)])
def test_gaps_short_against_the_content_are_bridged(missing: int, hertz: float, noise: float) -> None:
    time, signals = late(5000, 100, missing, hertz, noise)
    truth = late(5000, 100, missing, hertz, 0.0)[1]
    found = make_segments(time, signals.copy(), 2)
    assert found.gaps is not None and found.gaps.count == 49 and found.gaps.left == 0
    (segment,) = found.segments
    exact = np.sin(2 * np.pi * segment.time[:, None] * hertz * np.array([1.0, 0.7, 0.9, 0.4]) + np.arange(4))
    got = np.hstack([segment.theta, segment.tau])
    assert np.sqrt(np.mean((got - exact) ** 2)) < 1.1 * max(np.std(signals - truth), 1e-5)
    assert np.max(np.abs(got - exact)) < 8 * noise


@pytest.mark.parametrize("missing, hertz, noise", [(10, 25.0, 1e-3), (40, 6.0, 1e-4), (5, 60.0, 0.0)])
def test_longer_gaps_separate_segments(missing: int, hertz: float, noise: float) -> None:
    time, signals = late(5000, 100, missing, hertz, noise)
    found = make_segments(time, signals.copy(), 2)
    assert found.gaps is not None and found.gaps.count == 0 and found.gaps.left == 49
    assert len(found.segments) == 50 and all(len(s) == 100 - missing for s in found.segments)


@pytest.mark.parametrize("group, text", [("b.parquet", "g2"), ("sub/c.csv", "g3")])
def test_a_group_of_gaps_does_not_cost_the_others(small: Path, group: str, text: str) -> None:
    """Stretches of 20 rows cannot be used at all; those of 100 are too short for the observer."""
    for length in (20, 100):
        data = columns(1 if group.startswith("b") else 2)
        data["time"] = data["time"] + 5.0 * np.floor(np.arange(2000) / length)
        write_table(small / group, data)
        measurements = read_set(small)
        found = identify(measurements)
        used = (*found.groups, *found.validation_groups)
        assert found.converged and set(used) == {"g1", "g2", "g3"} - {text}
        if length == 20:
            left_out = [fact.groups for fact in measurements.warnings if fact.kind == "group-too-short"]
            assert left_out == [(text,)]
        else:
            assert [f.groups for f in found.facts if f.kind == "groups-not-used"] == [(text,)]


def test_the_advice_names_gaps_where_they_are_the_reason(small: Path) -> None:
    for seed, name in enumerate(("a.csv", "b.parquet")):
        data = columns(seed)
        write_table(small / name, data | {"time": data["time"] + 5.0 * np.floor(np.arange(2000) / 50)})
    with pytest.raises(
        InputError, match=r"gaps cut 2 groups into 80 stretches of at most 0\.098 s"
    ) as caught:
        identify(read_set(small))
    assert "bandwidth" not in str(caught.value)


def test_recorded_late_cycles(tmp_path: Path) -> None:
    """A pendulum's controller of 1.6 ms with 80 cycles of up to 5.9 ms in 6 s; stated: .09, .08 Nm."""
    source = REAL / "dfki_pendulum/late_cycles/mapping.toml"
    if not source.is_file():
        pytest.skip("the recordings are not here")
    import_logs(source, tmp_path / "set", accept=True)
    measurements = read_set(tmp_path / "set")
    assert [len(group.segments) for group in measurements.groups] == [1, 1]
    bridged = [fact.values for fact in measurements.warnings if fact.kind == "gaps-bridged"]
    assert any(v["count"] == 80 and v["longest"] == pytest.approx(5.94e-3, abs=5e-6) for v in bridged)
    found = identify(measurements, effects=["coulomb_friction"])
    assert found.converged and (found.groups, found.validation_groups) == (("a",), ("v",))
    coulomb = [p.value for p in found.parameters if p.name == "coulomb_friction.coulomb"]
    assert len(coulomb) == 2 and all(0.06 < value < 0.13 for value in coulomb)
