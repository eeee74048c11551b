"""Signals on different clocks: brought together, their offset estimated, gaps and disorder not hidden."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from import_data import (
    JOINTS,
    START,
    link_messages,
    message,
    motor_messages,
    truth,
    write_mapping,
    write_mcap,
    write_robot,
)

from flexviz.base.errors import InputError
from flexviz.data.importing import Imported, import_logs
from flexviz.data.importing.delays import JointTraces, delay_of
from flexviz.data.logs.assembling import Trace

DATA = truth(rows=1500)
THETA, TAU = '"/motor_states/joint#/position"', '"/motor_states/joint#/effort"'
LINK = '"/joint_states/joint#/position"'


@pytest.fixture(autouse=True)
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)


def run(
    folder: Path, messages: list[Any], *, q: str | None = LINK, time: str = "", tau: str = TAU
) -> Imported:
    write_robot(folder)
    write_mcap(folder / "run.mcap", messages)
    return import_logs(write_mapping(folder, ["run.mcap"], THETA, tau, q=q, time=time), None)


@pytest.mark.parametrize("late", [0.0, 0.0137, -0.1, 40.0])
def test_offset_of_the_link_clock(tmp_path: Path, late: float) -> None:
    """The link topic is stamped late: said to a tenth of a ms, also where the clocks never overlap."""
    done = run(tmp_path, motor_messages(DATA) + link_messages(DATA, late=late))
    (offset,) = done.offsets
    assert (offset.clock, offset.base) == ("/joint_states", "/motor_states")
    assert abs(offset.delay - late) < 1e-4 and offset.std < 1e-4
    clock = [s for s in done.issues if s.kind == "clock"]
    assert bool(clock) == (late != 0.0) and not done.wrong
    q = done.groups[0].table.q
    assert (q is None) == (late == 40.0)
    assert any("covers 0 %" in note for note in done.groups[0].notes) == (late == 40.0)
    if clock:  # what it says to write puts it right
        value = clock[0].values["shift"]
        done = shifted = run(
            tmp_path,
            motor_messages(DATA) + link_messages(DATA, late=late),
            time=f'shift = {{ "/joint_states" = {value} }}',
        )
        assert abs(shifted.offsets[0].delay) < 1e-4 and not shifted.issues
        q = shifted.groups[0].table.q
    group = done.groups[0]
    assert q is not None and len(q) > 0.95 * len(DATA.q)
    rows = np.searchsorted(DATA.time, group.table.time + group.zero - 1e-6)
    assert np.abs(q - DATA.q[rows]).max() < 3e-4  # 5e-5 of noise between samples, and a tenth of a ms


def test_offset_is_not_invented() -> None:
    """Where the two do not move alike nothing is said."""
    rng = np.random.default_rng(0)
    time = 0.002 * np.arange(2000)
    noise = [
        Trace("x", "c", time, np.cumsum(rng.normal(size=2000)) * 1e-3, np.arange(2000)) for _ in range(3)
    ]
    assert delay_of([JointTraces(*noise)]) is None
    slow = [Trace("x", "c", 0.2 * np.arange(100), np.sin(np.arange(100.0)), np.arange(100)) for _ in range(3)]
    assert delay_of([JointTraces(*slow)]) is None


def test_torque_on_a_topic_of_its_own(tmp_path: Path) -> None:
    """τ between the instants of θ is interpolated, and that is said."""
    both = [message(START + round(t * 1e9), JOINTS, p) for t, p in zip(DATA.time, DATA.theta, strict=True)]
    messages = [(START + round(t * 1e9), "/motor_states", m) for t, m in zip(DATA.time, both, strict=True)]
    between = 0.5 * (DATA.time[1:] + DATA.time[:-1])
    model = np.stack([np.interp(between, DATA.time, DATA.tau[:, j]) for j in range(2)], axis=1)
    for t, effort in zip(between, model, strict=True):
        ns = START + round(t * 1e9)
        messages.append((ns, "/torques", message(ns, JOINTS, [], effort)))
    done = run(tmp_path, messages, q=None, tau='"/torques/joint#/effort"')
    table = done.groups[0].table
    inner = slice(3, -3)
    assert np.abs(table.tau[inner] - DATA.tau[inner]).max() < 0.02  # noise of 2 mNm, averaged and spread
    assert any(
        '"/torques" (500 Hz) is brought to the instants of "/motor_states"' in n for n in done.groups[0].notes
    )


def test_gap_in_one_topic(tmp_path: Path) -> None:
    """Where τ has a gap there are no rows; where only q has one, q is bridged and the rows stay."""
    motor, link = motor_messages(DATA), link_messages(DATA)
    for entry in motor[600:700]:
        entry[2]["effort"] = []
    done = run(tmp_path, motor + link[:200] + link[220:])
    table = done.groups[0].table
    assert len(table.time) == 1400 and np.max(np.diff(table.time)) == pytest.approx(0.202)
    assert any("100 samples in longer gaps are left out" in note for note in done.groups[0].notes)
    assert table.q is not None and np.isfinite(table.q).all()


def test_order_and_repetition(tmp_path: Path) -> None:
    """Messages that come late are sorted, repeated stamps dropped, and both are said."""
    motor = motor_messages(DATA)
    late = [
        (logged + (9_000_000 if i % 50 == 7 else 0), topic, m) for i, (logged, topic, m) in enumerate(motor)
    ]
    done = run(tmp_path, late + motor[100:110], q=None)
    table, notes = done.groups[0].table, done.groups[0].notes
    assert np.array_equal(table.theta, DATA.theta)
    assert any("30 messages came late" in note for note in notes)
    assert any("10 rows that repeat the instant before were dropped" in note for note in notes)


def test_headers_without_a_time(tmp_path: Path) -> None:
    """A driver that leaves the stamp empty: the time of recording is used, and that is said."""
    motor = motor_messages(DATA)
    for _, _, content in motor:
        content["header"]["stamp"] = {"sec": 0, "nanosec": 0}
    done = run(tmp_path, motor, q=None)
    assert np.abs(done.groups[0].table.time - DATA.time).max() < 1e-9
    assert any("no time in its headers" in note for note in done.groups[0].notes)


def test_time_of_recording_can_be_chosen(tmp_path: Path) -> None:
    motor = [(logged + 10**9, topic, content) for logged, topic, content in motor_messages(DATA)]
    link = link_messages(DATA, late=500.0)
    link = [
        (START + round(t * 1e9) + 10**9, topic, m)
        for t, (_, topic, m) in zip(DATA.time[::4], link, strict=True)
    ]
    done = run(tmp_path, motor + link, time='clock = "log"')
    assert done.groups[0].table.q is not None and abs(done.offsets[0].delay) < 1e-3


def csv_of(folder: Path, time: np.ndarray, extra: dict[str, np.ndarray] | None = None) -> Path:
    write_robot(folder)
    columns = {
        "t": time,
        "p1": DATA.theta[:, 0],
        "p2": DATA.theta[:, 1],
        "m1": DATA.tau[:, 0],
        "m2": DATA.tau[:, 1],
    }
    columns |= extra or {}
    rows = [
        ",".join("" if np.isnan(x) else repr(float(x)) for x in row)
        for row in zip(*columns.values(), strict=True)
    ]
    (folder / "run.csv").write_text(",".join(columns) + "\n" + "\n".join(rows))
    return write_mapping(folder, ["run.csv"], '"p#"', '"m#"', time='column = "t"')


def test_rows_out_of_order_are_refused(tmp_path: Path) -> None:
    time = DATA.time.copy()
    time[900:] -= 1.5
    with pytest.raises(
        InputError, match=r"run\.csv, row 901, t: time goes back .* several runs in this file"
    ):
        import_logs(csv_of(tmp_path, time), None)
    with pytest.raises(InputError, match=r"t: \d+ of 1500 instants repeat the one before"):
        import_logs(csv_of(tmp_path, np.round(DATA.time / 0.01) * 0.01), None)


def test_sparse_table(tmp_path: Path) -> None:
    """Rows of several sources in one table, each filling only its own cells, as plotting tools write them."""
    count = len(DATA.time)
    time = np.sort(np.concatenate([DATA.time, DATA.time + 0.0007]))
    nothing = np.full((2 * count, 4), np.nan)
    nothing[::2, :2], nothing[1::2, 2:] = DATA.theta, DATA.tau
    write_robot(tmp_path)
    rows = [
        ",".join("" if np.isnan(x) else repr(float(x)) for x in (t, *row))
        for t, row in zip(time, nothing, strict=True)
    ]
    (tmp_path / "run.csv").write_text("t,p1,p2,m1,m2\n" + "\n".join(rows))
    done = import_logs(write_mapping(tmp_path, ["run.csv"], '"p#"', '"m#"', time='column = "t"'), None)
    table = done.groups[0].table
    assert np.array_equal(table.theta, DATA.theta[: len(table.time)])
    assert any("does not have a value in every row and is interpolated" in n for n in done.groups[0].notes)


def test_missing_cells_of_theta(tmp_path: Path) -> None:
    """A hole in θ of the first joint leaves its rows out; a short one in another column is bridged."""
    p1, p2 = DATA.theta[:, 0].copy(), DATA.theta[:, 1].copy()
    p1[500:520] = np.nan
    p2[800] = np.nan
    done = import_logs(csv_of(tmp_path, DATA.time, {"p1": p1, "p2": p2}), None)
    table = done.groups[0].table
    assert len(table.time) == 1480
    assert np.abs(table.theta - np.delete(DATA.theta, slice(500, 520), axis=0)).max() < 2e-4


def test_signal_with_a_time_of_its_own(tmp_path: Path) -> None:
    late = DATA.time + 0.004
    file = csv_of(tmp_path, DATA.time, {"t2": late, "q1": DATA.q[:, 0], "q2": DATA.q[:, 1]})
    text = file.read_text()
    for j in (1, 2):
        text = text.replace(f'tau = "m{j}"', f'tau = "m{j}"\nq = {{ from = "q{j}", time = "t2" }}')
    file.write_text(text)
    done = import_logs(file, None)
    (offset,) = done.offsets
    assert (offset.clock, offset.base) == ("t2", "t") and abs(offset.delay - 0.004) < 1e-4
