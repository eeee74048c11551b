"""Every format gives back exactly what was recorded: times, angles and torques, in any names and units."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as papq
import pytest
from import_data import (
    START,
    lists,
    message,
    motor_messages,
    truth,
    write_lerobot,
    write_mapping,
    write_mcap,
    write_robot,
)
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from flexviz.base.errors import InputError
from flexviz.data.importing import import_logs, inspect_logs
from flexviz.data.logs import find_logs, formats
from flexviz.data.logs.formats.base import Log, LogFormat, LogTable, ReadOptions
from flexviz.data.measurements import read_set

DATA = truth(rows=1000)


@pytest.fixture(autouse=True)
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is tested here is reading; fitting the whole model each time would only take time."""
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)


def imported(mapping: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, θ and τ of the first group of the set that an import writes."""
    done = import_logs(mapping, mapping.parent / "set")
    assert done.folder is not None, done.issues
    group = read_set(done.folder).groups[0]
    assert len(group.segments) == 1
    return group.time, group.segments[0].theta, group.segments[0].tau


def check(mapping: Path, tolerance: float = 1e-12) -> None:
    """An import gives the truth back."""
    time, theta, tau = imported(mapping)
    assert np.abs(time - DATA.time).max() < 1e-9
    assert np.abs(theta - DATA.theta).max() < tolerance
    assert np.abs(tau - DATA.tau).max() < 100 * tolerance


def wide() -> dict[str, np.ndarray]:
    """Columns as people call them, in degrees and mNm and with a time in ms."""
    table: dict[str, np.ndarray] = {"Time [ms]": DATA.time * 1e3}
    for j in range(2):
        table |= {f"Pos {j + 1} [deg]": np.rad2deg(DATA.theta[:, j]), f"M {j + 1}": 1e3 * DATA.tau[:, j]}
    return table


def rows_of(table: dict[str, np.ndarray], separator: str, point: str = ".") -> list[str]:
    return [
        separator.join(repr(float(x)).replace(".", point) for x in row)
        for row in zip(*table.values(), strict=True)
    ]


def comma(file: Path) -> None:
    pacsv.write_csv(pa.table(wide()), file)


def semicolon_with_decimal_comma_and_units(file: Path) -> None:
    names = [name.split(" [")[0] for name in wide()]
    lines = ["# recorded today", ";".join(names), "ms;deg;mNm;deg;mNm", *rows_of(wide(), ";", ",")]
    file.write_text("\n".join(lines), encoding="cp1252")


def tabs_with_hash_header(file: Path) -> None:
    file.write_text("# " + "\t".join(wide()) + "\n" + "\n".join(rows_of(wide(), "\t")))


def spaces_without_header(file: Path) -> None:
    file.write_text("\n".join("   " + row for row in rows_of(wide(), "   ")) + "\n")


def text_and_empty_columns_beside(file: Path) -> None:
    header = ",".join(f'"{name}"' for name in [*wide(), "mode", "nothing"])
    file.write_bytes(
        ("\ufeff" + header + "\r\n" + "\r\n".join(f"{row},run," for row in rows_of(wide(), ","))).encode()
    )


@pytest.mark.parametrize(
    "write, time, theta, tau",
    [
        (comma, "Time [ms]", "Pos # [deg]", "M #"),
        (semicolon_with_decimal_comma_and_units, "Time", "Pos #", "M #"),
        (tabs_with_hash_header, "Time [ms]", "Pos # [deg]", "M #"),
        (spaces_without_header, "column1", "columnP#", "columnM#"),
        (text_and_empty_columns_beside, "Time [ms]", "Pos # [deg]", "M #"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_wide_csv(tmp_path: Path, write: Callable[[Path], None], time: str, theta: str, tau: str) -> None:
    write_robot(tmp_path)
    write(tmp_path / "run.csv")
    mapping = write_mapping(
        tmp_path,
        ["run.csv"],
        f'{{ from = "{theta}", unit = "deg" }}',
        f'{{ from = "{tau}", unit = "mNm" }}',
        time=f'column = "{time}"\nunit = "ms"',
    )
    if write is spaces_without_header:
        names = {"columnP1": "column2", "columnM1": "column3", "columnP2": "column4", "columnM2": "column5"}
        text = mapping.read_text()
        for name, column in names.items():
            text = text.replace(name, column)
        mapping.write_text(text)
    check(mapping, 1e-11)


def test_csv_states_its_units_and_what_cannot_be_used(tmp_path: Path) -> None:
    semicolon_with_decimal_comma_and_units(tmp_path / "a.csv")
    log = formats.open_log(tmp_path / "a.csv", ReadOptions())
    assert log.tables[0].units == {"Time": "ms", "Pos 1": "deg", "M 1": "mNm", "Pos 2": "deg", "M 2": "mNm"}
    text_and_empty_columns_beside(tmp_path / "b.csv")
    log = formats.open_log(tmp_path / "b.csv", ReadOptions())
    assert log.unusable["mode"] == 'row 1 (line 2) holds "run", expected a number'
    assert "nothing" in log.unusable
    lines = ["t,x,y"] + [f"{0.001 * i},{i if i != 60 else 'oops'},{i}" for i in range(100)]
    (tmp_path / "c.csv").write_text("\n".join(lines))
    log = formats.open_log(tmp_path / "c.csv", ReadOptions())
    assert log.unusable == {"x": 'row 61 (line 62) holds "oops", expected a number'}
    assert list(log.columns) == ["t", "y"]


@pytest.mark.parametrize("separator", [",", "\t", " "])
def test_blank_lines_between_rows(tmp_path: Path, separator: str) -> None:
    """Text mode on Windows doubles the ends of lines."""
    header = separator.join(["t", "p1", "m1", "p2", "m2"])
    (tmp_path / "run.csv").write_bytes("\r\n\r\n".join([header, *rows_of(wide(), separator)]).encode())
    write_robot(tmp_path)
    theta, tau = '{ from = "p#", unit = "deg" }', '{ from = "m#", unit = "mNm" }'
    check(write_mapping(tmp_path, ["run.csv"], theta, tau, time='column = "t"\nunit = "ms"'), 1e-11)


@pytest.mark.parametrize("cut", [3, 22, 60])
@pytest.mark.parametrize("separator", [",", " "])
def test_a_last_line_that_is_cut_off_is_left_out(tmp_path: Path, separator: str, cut: int) -> None:
    """As a logger leaves it that is switched off; the same line within the file is an error."""
    rows = rows_of(wide(), separator)
    last = separator.join([*rows[-1].split(separator)[:-1], "-1.5e-3"])
    header = separator.join(["t", "p1", "m1", "p2", "m2"])
    text = "\n".join([header, *rows[:-1], last[:-cut]])
    (tmp_path / "run.csv").write_text(text)
    log = formats.open_log(tmp_path / "run.csv", ReadOptions())
    assert log.columns["p1"].rows == 999 and not log.unusable
    assert re.fullmatch(r"the last line is cut off \(.*\) and left out", "".join(log.notes))
    assert np.array_equal(log.columns["m2"].columns["m2"], 1e3 * DATA.tau[:999, 1])
    if cut > 3:  # "-1.5" is a number
        (tmp_path / "run.csv").write_text("\n".join([header, *rows[:50], last[:-60], *rows[50:]]))
        with pytest.raises(InputError, match=r"row 51 \(line 52\).* one per column: complete or"):
            formats.open_log(tmp_path / "run.csv", ReadOptions())


def test_iso_times_stay_exact(tmp_path: Path) -> None:
    stamps = np.datetime64(START, "ns") + np.round(DATA.time * 1e9).astype("timedelta64[ns]")
    table = {"stamp": pa.array(stamps), **{f"p{j + 1}": DATA.theta[:, j] for j in range(2)}}
    table |= {f"t{j + 1}": DATA.tau[:, j] for j in range(2)}
    write_robot(tmp_path)
    for suffix, write in (("csv", pacsv.write_csv), ("parquet", papq.write_table)):
        write(pa.table(table), tmp_path / f"run.{suffix}")
        mapping = write_mapping(tmp_path, [f"run.{suffix}"], '"p#"', '"t#"', time='column = "stamp"')
        check(mapping)
        (tmp_path / "set").rename(tmp_path / f"set-{suffix}")


def test_parquet_with_lists_and_a_step(tmp_path: Path) -> None:
    fixed = pa.FixedSizeListArray.from_arrays(pa.array(DATA.tau.ravel()), 2)
    table = pa.table({"q": lists(DATA.theta, pa.float64()), "tau": fixed, "name": ["x"] * len(DATA.time)})
    papq.write_table(table, tmp_path / "run.parquet")
    write_robot(tmp_path)
    mapping = write_mapping(tmp_path, ["run.parquet"], '"q[#]"', '"tau[#]"', time="step = 0.002")
    mapping.write_text(mapping.read_text().replace("[1]", "[0]").replace("[2]", "[1]"))
    check(mapping)


@pytest.mark.parametrize("layout", ["columns", "rows", "struct", "simulink", "3-D"])
def test_matlab(tmp_path: Path, layout: str) -> None:
    time = DATA.time[:, None]
    variables = {
        "columns": {"t": time, "q": DATA.theta, "tau": DATA.tau, "note": "run 1", "K": 3.0},
        "rows": {"t": time.T, "q": DATA.theta.T, "tau": DATA.tau.T},
        "struct": {"log": {"t": time, "q": DATA.theta, "tau": DATA.tau, "other": {"x": np.arange(7.0)}}},
        "3-D": {"t": time, "q": DATA.theta.T[None], "tau": DATA.tau.T[None]},
        "simulink": {"out": {"time": time, "signals": [{"values": DATA.theta}, {"values": DATA.tau}]}},
    }[layout]
    theta, tau, when = {
        "columns": ("q(:,#)", "tau(:,#)", "t"),
        "rows": ("q(#,:)", "tau(#,:)", "t"),
        "3-D": ("q(#,:)", "tau(#,:)", "t"),
        "struct": ("log.q(:,#)", "log.tau(:,#)", "log.t"),
        "simulink": ("out.signals(1).values(:,#)", "out.signals(2).values(:,#)", "out.time"),
    }[layout]
    savemat(tmp_path / "run.mat", variables, do_compression=True)
    write_robot(tmp_path)
    check(write_mapping(tmp_path, ["run.mat"], f'"{theta}"', f'"{tau}"', time=f'column = "{when}"'))


def records() -> list[dict[str, Any]]:
    """One record per instant."""
    rows = zip(DATA.time, DATA.theta, DATA.tau, strict=True)
    return [{"t": t, "state": {"q": q.tolist()}, "tau": tau.tolist(), "mode": "\u2028"} for t, q, tau in rows]


def npz(file: Path) -> None:
    objects = np.array([{}, None], dtype=object)
    np.savez(file, t=DATA.time, state=DATA.theta, tau=DATA.tau.T, note="run 1", objects=objects)


def json_columns(file: Path) -> None:
    content = {"t": DATA.time.tolist(), "state": {"q": DATA.theta.tolist()}, "tau": DATA.tau.T.tolist()}
    file.write_text(json.dumps(content | {"note": "run 1", "list": ["a", 1, None]}))


def json_records(file: Path) -> None:
    file.write_text(json.dumps(records()))


def json_lines(file: Path) -> None:
    file.write_text("\n".join(json.dumps(one, ensure_ascii=False) for one in records()), encoding="utf-8")


@pytest.mark.parametrize(
    "write, name, theta, tau",
    [
        (npz, "run.npz", "state[:,#]", "tau[#,:]"),
        (json_columns, "run.json", "state.q[:,#]", "tau[#,:]"),
        (json_records, "run.json", "state.q[:,#]", "tau[:,#]"),
        (json_lines, "run.jsonl", "state.q[:,#]", "tau[:,#]"),
    ],
)
def test_numpy_and_json(
    tmp_path: Path, write: Callable[[Path], None], name: str, theta: str, tau: str
) -> None:
    write(tmp_path / name)
    write_robot(tmp_path)
    mapping = write_mapping(tmp_path, [name], f'"{theta}"', f'"{tau}"', time='column = "t"')
    text = mapping.read_text().replace(",1]", ",0]").replace(",2]", ",1]")
    mapping.write_text(text.replace("[1,", "[0,").replace("[2,", "[1,"))
    check(mapping)


def test_files_beside_logs_are_no_logs(tmp_path: Path) -> None:
    npz(tmp_path / "run.npz")
    json_columns(tmp_path / "about.json")
    assert [source.path.name for source in find_logs([tmp_path])] == ["run.npz"]
    unusable = formats.open_log(tmp_path / "run.npz", ReadOptions()).unusable
    assert unusable["objects"] == "it holds Python objects"


@pytest.mark.parametrize("order", ["C", "F"])
def test_stacked_values_are_taken_apart(tmp_path: Path, order: Any) -> None:
    """All values of joint 1, then of joint 2, or alternating, in one column beside a shorter time."""
    stacked = {"q": DATA.theta.ravel(order), "tau": DATA.tau.ravel(order)}
    savemat(tmp_path / "run.mat", {"t": DATA.time, **stacked})
    write_robot(tmp_path)
    time = 'column = "t"'
    check(write_mapping(tmp_path, ["run.mat"], '"q part # of 2"', '"tau part # of 2"', time=time))
    (note,) = formats.open_log(tmp_path / "run.mat", ReadOptions()).notes
    assert note == '"q", "tau": the values of 2 signals in one column were taken apart'
    inspection = inspect_logs([tmp_path / "run.mat"], str(tmp_path / "robot.urdf"))
    signals = [joint.signals["tau"]["from"] for joint in inspection.draft.joints.values()]
    assert signals == ["tau part 1 of 2", "tau part 2 of 2"] and not inspection.issues


def test_a_row_per_joint(tmp_path: Path) -> None:
    """A table with each instant once per joint; a clock that is only too coarse is none."""
    lines = ["t,joint,position,torque"]
    for t, theta, tau in zip(DATA.time, DATA.theta, DATA.tau, strict=True):
        lines += [f"{t!r},joint{j + 1},{theta[j]!r},{tau[j]!r}" for j in range(2)]
    (tmp_path / "run.csv").write_text("\n".join(lines).replace("np.float64(", "").replace(")", ""))
    write_robot(tmp_path)
    theta, tau = '"position part # of 2"', '"torque part # of 2"'
    check(write_mapping(tmp_path, ["run.csv"], theta, tau, time='column = "t"'))
    coarse = {"t": np.repeat(DATA.time[::2], 2), "p": DATA.theta[:, 0]}
    pacsv.write_csv(pa.table(coarse), tmp_path / "coarse.csv")
    assert set(formats.open_log(tmp_path / "coarse.csv", ReadOptions()).columns) == {"t", "p"}


def test_matlab_7_3_says_what_to_do(tmp_path: Path) -> None:
    file = tmp_path / "run.mat"
    file.write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" ") + b"\x89HDF\r\n\x1a\n" + bytes(600)
    )
    with pytest.raises(InputError, match=r"version 7\.3 is HDF5.*'-v7'.*parquetwrite"):
        formats.open_log(file, ReadOptions())


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
@pytest.mark.parametrize(
    "names", [["joint1.pos", "joint2.pos"], {"motors": ["joint1.pos", "joint2.pos"]}, None]
)
def test_lerobot(tmp_path: Path, version: str, names: object) -> None:
    other = truth(seed=1, rows=400)
    write_lerobot(tmp_path / "data", [other, DATA, other], version, names)
    write_robot(tmp_path)
    entry = "/joint#.pos" if names else "[#]"
    mapping = write_mapping(
        tmp_path,
        ['file = "data"\nepisode = 1', 'file = "data"\nepisode = 2'],
        f'"observation.state{entry}"',
        f'"observation.effort{entry}"'.replace(".pos", ".effort"),
    )
    if not names:
        mapping.write_text(mapping.read_text().replace("[1]", "[0]").replace("[2]", "[1]"))
    check(mapping)
    assert [source.episode for source in find_logs([tmp_path / "data"])] == [0, 1, 2]


def bag2(path: Path, plugin: StoragePlugin) -> Path:
    """A ROS 2 bag of the motor topic, by the writer of rosbags."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = store.types["sensor_msgs/msg/JointState"]
    with Writer2(path, version=8, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/motor_states", kind.__msgtype__, typestore=store)
        for logged, _, content in motor_messages(DATA):
            writer.write(topic, logged, store.serialize_cdr(state(store, content), kind.__msgtype__))
    return path


def state(store: object, content: dict, **header: object) -> object:
    """A JointState of rosbags."""
    types = store.types  # type: ignore[attr-defined]
    stamp = types["builtin_interfaces/msg/Time"](**content["header"]["stamp"])
    head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **header)
    arrays = {key: np.array(content[key]) for key in ("position", "velocity", "effort")}
    return types["sensor_msgs/msg/JointState"](header=head, name=content["name"], **arrays)


@pytest.mark.parametrize("kind", ["mcap", "folder of mcap", "folder of db3", "db3", "ROS 1"])
def test_bags(tmp_path: Path, kind: str) -> None:
    write_robot(tmp_path)
    name = "run.mcap"
    if kind == "mcap":
        write_mcap(tmp_path / name, motor_messages(DATA))
    elif kind == "ROS 1":
        name = "run.bag"
        store = get_typestore(Stores.ROS1_NOETIC)
        with Writer1(tmp_path / name) as writer:
            topic = writer.add_connection("/motor_states", "sensor_msgs/msg/JointState", typestore=store)
            for logged, _, content in motor_messages(DATA):
                raw = store.serialize_ros1(state(store, content, seq=0), "sensor_msgs/msg/JointState")
                writer.write(topic, logged, raw)
    else:
        bag2(tmp_path / "bag", StoragePlugin.SQLITE3 if "db3" in kind else StoragePlugin.MCAP)
        name = "bag/bag.db3" if kind == "db3" else "bag"
    theta, tau = '"/motor_states/joint#/position"', '"/motor_states/joint#/effort"'
    check(write_mapping(tmp_path, [name], theta, tau))


def test_two_drivers_on_one_topic(tmp_path: Path) -> None:
    """An arm and a gripper that publish alternately, and joints whose order changes, are told apart."""
    messages = []
    for i, (logged, topic, content) in enumerate(motor_messages(DATA)):
        ns = START + round(DATA.time[i] * 1e9)
        messages.append((logged, topic, content))
        messages.append((logged + 900_000, topic, message(ns + 900_000, ["finger"], [0.1])))
        if i % 2:
            for key in ("name", "position", "effort"):
                content[key] = content[key][::-1]
    write_mcap(tmp_path / "run.mcap", messages)
    log = formats.open_log(tmp_path / "run.mcap", ReadOptions())
    assert [table.rows for table in log.tables] == [1000, 1000]
    assert "/motor_states/finger/effort" in log.unusable
    write_robot(tmp_path)
    check(
        write_mapping(
            tmp_path, ["run.mcap"], '"/motor_states/joint#/position"', '"/motor_states/joint#/effort"'
        )
    )


def test_folder_of_logs(tmp_path: Path) -> None:
    comma(tmp_path / "b.csv")
    comma(tmp_path / "a.csv")
    (tmp_path / "notes.md").write_text("no log")
    assert [source.path.name for source in find_logs([tmp_path])] == ["a.csv", "b.csv"]
    with pytest.raises(InputError, match="given twice"):
        find_logs([tmp_path, tmp_path / "a.csv"])


def test_a_format_is_one_entry_of_the_registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every suffix and mark belongs to one format, and a new format needs nothing but its entry."""
    marks = [mark for known in formats.FORMATS for mark in (*known.suffixes, known.mark) if mark]
    assert len(set(marks)) == len(marks)
    assert all(known.suffixes or known.mark for known in formats.FORMATS)

    def read(path: Path, options: ReadOptions) -> Log:
        values = np.array(path.read_text().split("|"), dtype=float)
        return Log(path, "pipes", (LogTable("", {"x": values}),))

    pipes = LogFormat("pipes", read, suffixes=(".pipes",))
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS, pipes))
    (tmp_path / "a.pipes").write_text("|".join(map(str, range(50))))
    assert [source.path.name for source in find_logs([tmp_path])] == ["a.pipes"]
    assert formats.open_log(tmp_path / "a.pipes", ReadOptions()).columns["x"].rows == 50
