"""The readers that `benchmarks.fuzz` tries, with the good files that it spoils."""

from __future__ import annotations

import atexit
import io
import shutil
import subprocess
import sys
import tempfile
import zipfile
from functools import lru_cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as papq
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from benchmarks.fuzz import Reader
from flexviz.base.errors import FlexvizError
from flexviz.content.rendering import panel
from flexviz.content.results import read_result
from flexviz.content.scene import robot_shape
from flexviz.content.session import open_session, save_session
from flexviz.content.topics import set_blocks
from flexviz.data.importing import import_logs
from flexviz.data.logs.formats import LogSource, ReadOptions, find_logs, open_run
from flexviz.data.measurements import read_set
from flexviz.outlets.app.sets import open_set
from flexviz.outlets.app.uploads import UploadFolder, take
from flexviz.outlets.recording import check_recording, read_recording, record_set
from flexviz.robot.robot import Robot
from tests import import_data
from tests.small_session import small_session
from tests.small_set import write_small_set

OPTIONS = ReadOptions()
ROWS = 300


def read_session(folder: Path) -> None:
    """Open a session, and use its results as the app and reports do."""
    opened = open_set(folder / "kept")
    assert opened.session is not None
    for result in (opened.session.analysis.identification, opened.session.analysis.diagnosis):
        if result is not None:
            result.document().summary()
    panel(set_blocks(opened.measurements, opened.shape.missing))


def read_robot(folder: Path) -> None:
    """A robot with its drawing."""
    robot = Robot.load(folder / "robot.urdf")
    robot_shape(robot)


def read_logs(folder: Path) -> None:
    """Every log of a folder."""
    for source in find_logs([folder]):
        open_run(source, OPTIONS)


def read_log(name: str, folder: Path) -> None:
    """One log."""
    open_run(LogSource(folder / name), OPTIONS)


def read_mapping(folder: Path) -> None:
    """A mapping with its logs, imported."""
    import_logs(folder / "mapping.toml", None)


class Decoder:
    """In place of the process that `check_recording` starts: a fork of one that has loaded Rerun's reader."""

    SERVER = """import os, sys
from rerun.chunk import RrdReader  # its threads begin in the fork
for line in sys.stdin:
    number = os.fork()
    if number == 0:
        failed = 1
        try:
            file = line.rstrip("\\n")
            for chunk in RrdReader(file).stream():
                chunk.to_record_batch()
            RrdReader(file).store().summary()
            failed = 0
        finally:
            os._exit(failed)
    print(os.waitstatus_to_exitcode(os.waitpid(number, 0)[1]), flush=True)"""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", self.SERVER], text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        atexit.register(self.close)

    def close(self) -> None:
        self.process.communicate()

    def run(self, command: list[str], **_: Any) -> SimpleNamespace:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(command[-1] + "\n")
        self.process.stdin.flush()
        return SimpleNamespace(returncode=int(self.process.stdout.readline()))


decoder = lru_cache(maxsize=1)(Decoder)  # started when first used


def read_rrd(folder: Path) -> None:
    """A recording without its SHA-256."""
    with mock.patch("flexviz.outlets.recording.reading.subprocess.run", decoder().run):
        check_recording(folder / "a.rrd")
    read_recording(folder / "a.rrd")


def read_upload(folder: Path) -> None:
    """A zip that a browser sends."""
    uploads = UploadFolder()
    try:
        uploads.unpack("set.zip", (folder / "set.zip").read_bytes())
        uploads.missing()
        uploads.urdf()
        with tempfile.TemporaryDirectory() as parent:
            take(uploads.folder, Path(parent) / "in")
    finally:
        uploads.close()


def read_uploaded_files(folder: Path) -> None:
    """The files of a set that a browser sends one by one."""
    uploads = UploadFolder()
    try:
        for file in sorted(folder.rglob("*.*")):
            uploads.put(file.name, file.read_bytes())
            try:
                uploads.missing()
            except FlexvizError:
                uploads.urdf()
    finally:
        uploads.close()


# -- good files ------------------------------------------------------------------------------------------


def data(rows: int = ROWS) -> SimpleNamespace:
    return import_data.truth(0, rows)


def columns(rows: int = ROWS) -> dict[str, np.ndarray]:
    made = data(rows)
    motors = {f"{name}{i + 1}": getattr(made, name)[:, i] for name in ("theta", "tau") for i in (0, 1)}
    return {"time": made.time, **motors}


def make_session(folder: Path) -> None:
    measurements, session = small_session(folder / "small")
    save_session(session, measurements, folder / "kept")


def make_mapping(folder: Path) -> None:
    import_data.write_robot(folder)
    pacsv.write_csv(pa.table(columns()), folder / "a.csv")
    theta, tau = '{ from = "theta#", unit = "rad" }', '{ from = "tau#", unit = "Nm" }'
    import_data.write_mapping(folder, ["a.csv"], theta, tau, time='column = "time"')


def make_csv(folder: Path) -> None:
    pacsv.write_csv(pa.table(columns()), folder / "a.csv")
    text = (folder / "a.csv").read_text()
    (folder / "b.csv").write_text(text.replace(",", ";").replace(".", ","))
    (folder / "c.txt").write_text("# a log\n" + text.replace(",", " ").replace('"', ""))


def make_parquet(folder: Path) -> None:
    table = pa.table(columns())
    lists = pa.array(data().theta.tolist())
    papq.write_table(table.append_column("positions", lists), folder / "a.parquet")


def make_npz(folder: Path) -> None:
    np.savez_compressed(folder / "a.npz", time=data().time, theta=data().theta, tau=data().tau)


def make_mat(folder: Path) -> None:
    log = {"t": data().time, "theta": data().theta, "tau": data().tau, "name": "arm"}
    savemat(folder / "a.mat", {"log": log, "x": data().time}, do_compression=True)
    savemat(folder / "b.mat", {"log": log})
    savemat(folder / "c.mat", {"x": data().theta, "t": data().time}, format="4")


def make_json(folder: Path) -> None:
    rows = [{name: float(x[i]) for name, x in columns(64).items()} for i in range(64)]
    text = str(rows).replace("'", '"')
    (folder / "a.json").write_text(text)


def make_mcap(folder: Path) -> None:
    messages = import_data.motor_messages(data()) + import_data.link_messages(data())
    import_data.write_mcap(folder / "a.mcap", messages)


def make_bag(folder: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "sensor_msgs/msg/JointState"
    types = store.types
    with BagWriter(folder / "a.bag") as writer:
        connection = writer.add_connection("/motor_states", kind, typestore=store)
        for logged, _, content in import_data.motor_messages(data(64)):
            stamp = types["builtin_interfaces/msg/Time"](**content["header"]["stamp"])
            header = types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="")
            values = {name: np.array(content[name]) for name in ("position", "velocity", "effort")}
            message = types[kind](header=header, name=content["name"], **values)
            writer.write(connection, logged, store.serialize_ros1(message, kind))


def make_lerobot(folder: Path) -> None:
    names = {"motors": ["a.pos", "b.pos"]}
    import_data.write_lerobot(folder / "set", [data(64), data(80)], "v2.1", names)


def make_rrd(folder: Path) -> None:
    measurements = read_set(write_small_set(folder / "small"))
    record_set(measurements, None, folder / "a.rrd")
    (folder / "a.rrd.sha256").unlink(missing_ok=True)


def make_upload(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        made = write_small_set(Path(temporary) / "small")
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(made.rglob("*.*")):
                archive.write(file, file.relative_to(made).as_posix())
        (folder / "set.zip").write_bytes(buffer.getvalue())


def make_result(folder: Path) -> None:
    kept = small_session(folder / "small")[1].analysis
    from flexviz.base.files import as_json

    for name in ("identification", "diagnosis"):
        (folder / f"{name}.json").write_text(as_json(getattr(kept, name).to_dict()))
    shutil.rmtree(folder / "small")


def read_results(folder: Path) -> None:
    for file in sorted(folder.glob("*.json")):
        read_result(file).summary()


READERS: dict[str, Reader] = {
    "set": Reader(write_small_set, "*.[tcp]*", read_set, 4),
    "urdf": Reader(write_small_set, "*.urdf", read_robot, 6),
    "session": Reader(make_session, "kept/session.json", read_session, 1),
    "results": Reader(make_session, "kept/results/*.npz", lambda folder: open_session(folder / "kept"), 1),
    "mapping": Reader(make_mapping, "*.*", read_mapping, 1),
    "rrd": Reader(make_rrd, "*.rrd", read_rrd, 1),
    "mcap": Reader(make_mcap, "*.mcap", read_logs, 4),
    "bag": Reader(make_bag, "*.bag", read_logs, 6),
    "csv": Reader(make_csv, "*.*", read_logs, 4),
    "mat": Reader(make_mat, "*.mat", read_logs, 10),
    "npz": Reader(make_npz, "*.npz", read_logs, 10),
    "parquet": Reader(make_parquet, "*.parquet", read_logs, 10),
    "json": Reader(make_json, "*.json", partial(read_log, "a.json"), 10),
    "lerobot": Reader(make_lerobot, "set/**/*.*", lambda folder: read_logs(folder / "set"), 10),
    "zip": Reader(make_upload, "*.zip", read_upload, 3),
    "upload": Reader(write_small_set, "*.[tu]*", read_uploaded_files, 4),
    "result": Reader(make_result, "*.json", read_results, 2),
}
