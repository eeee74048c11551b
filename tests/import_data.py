"""Logs of known truth in the formats that people have: the arm of `small_set` in their units and names."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
from mcap_ros2.writer import Writer

from flexviz.robot._pinocchio import pin
from tests.small_set import URDF

JOINTS = ("joint1", "joint2")
START = 1_700_000_000_123_456_789  # [ns] since 1970: more digits than a float has
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


STIFFNESS = np.array([2000.0, 1500.0])  # [Nm/rad]


def truth(seed: int = 0, rows: int = 1500, step: float = 0.002) -> SimpleNamespace:
    """time (N,) [s], theta, tau, q (N, 2) [rad], [Nm] at the joint side; three frequencies a joint.

    The torques are the arm's, with viscous friction and a little noise.
    """
    rng = np.random.default_rng(seed)
    time = step * np.arange(rows)
    w = np.array([1.9, 2.6]) * (1 + 0.2 * seed) * np.array([[1.0], [2.3], [3.7]])  # (3, 2) [rad/s]
    size = np.array([[0.5], [0.25], [0.1]]) * np.ones(2)
    phase = time[:, None, None] * w + np.array([[0.0], [1.0], [2.0]])
    q = np.sum(size * np.sin(phase), axis=1)
    v = np.sum(size * w * np.cos(phase), axis=1)
    a = np.sum(-size * w**2 * np.sin(phase), axis=1)
    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)]) + v
    theta = q + tau / STIFFNESS + 2e-5 * rng.normal(size=q.shape)
    return SimpleNamespace(time=time, theta=theta, tau=tau + 2e-3 * rng.normal(size=q.shape), q=q)


def write_robot(folder: Path) -> Path:
    """The arm's description."""
    file = folder / "robot.urdf"
    file.write_text(URDF)
    return file


def write_mapping(
    folder: Path,
    logs: Sequence[str],
    theta: str,
    tau: str,
    *,
    q: str | None = None,
    time: str = "",
    gear: float = 1.0,
    constant: float | None = None,
    top: str = "",
) -> Path:
    """A mapping of both joints; `#` in a signal's TOML stands for the joint's number."""
    lines = ["format = 1", 'robot = "robot.urdf"', top, "[time]" if time else "", time]
    for i, log in enumerate(logs):
        lines += ["[[logs]]", f'group = "g{i + 1}"', log if "=" in log else f'file = "{log}"']
    for i, joint in enumerate(JOINTS, start=1):
        lines += [f"[joints.{joint}]", f"gear = {gear}", f"theta = {theta}".replace("#", str(i))]
        lines += [f"tau = {tau}".replace("#", str(i))]
        lines += [f"q = {q}".replace("#", str(i))] if q else []
        lines += [f"torque_constant = {constant}"] if constant else []
    file = folder / "mapping.toml"
    file.write_text("\n".join(lines) + "\n")
    return file


def message(
    ns: int, names: Sequence[str], position: Any, effort: Any = (), velocity: Any = ()
) -> dict[str, Any]:
    """A JointState as the writer takes it."""
    header = {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": ""}
    values = {"position": position, "velocity": velocity, "effort": effort}
    return {"header": header, "name": list(names), **{k: [float(x) for x in v] for k, v in values.items()}}


def write_mcap(file: Path, messages: Sequence[tuple[int, str, dict[str, Any]]]) -> Path:
    """An MCAP file of (time of recording [ns], topic, JointState), by mcap's writer for ROS 2."""
    with file.open("wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for logged, topic, content in sorted(messages, key=lambda item: item[0]):
            writer.write_message(topic, schema, content, log_time=logged, publish_time=logged)
        writer.finish()
    return file


def motor_messages(
    data: SimpleNamespace,
    *,
    gear: Any = 1.0,
    constant: Any = 1.0,
    sign: Any = 1.0,
    names: Sequence[str] = JOINTS,
) -> list[tuple[int, str, dict[str, Any]]]:
    """θ before the gear and the motor's current, on /motor_states."""
    position = data.theta * gear * sign
    effort = data.tau / gear / constant * sign
    stamps = START + np.round(data.time * 1e9).astype(np.int64)
    return [
        (int(ns) + 250_000, "/motor_states", message(int(ns), names, p, e))
        for ns, p, e in zip(stamps, position, effort, strict=True)
    ]


def link_messages(
    data: SimpleNamespace, *, every: int = 4, late: float = 0.0, names: Sequence[str] = JOINTS
) -> list[tuple[int, str, dict[str, Any]]]:
    """q on /joint_states, less often and stamped `late` seconds too late."""
    stamps = START + np.round((data.time[::every] + late) * 1e9).astype(np.int64)
    return [
        (int(ns) + 400_000, "/joint_states", message(int(ns), names, p))
        for ns, p in zip(stamps, data.q[::every], strict=True)
    ]


def write_lerobot(folder: Path, episodes: Sequence[SimpleNamespace], version: str, names: Any) -> Path:
    """A LeRobot dataset with positions in observation.state and torques in observation.effort."""
    step = float(np.median(np.diff(episodes[0].time)))
    tables = []
    for number, data in enumerate(episodes):
        count = len(data.time)
        tables.append(
            pa.table(
                {
                    "observation.state": lists(data.theta, pa.float64()),
                    "observation.effort": lists(data.tau, pa.float64()),
                    "timestamp": pa.array((np.arange(count) * step).astype(np.float32)),
                    "frame_index": pa.array(np.arange(count)),
                    "episode_index": pa.array(np.full(count, number)),
                    "index": pa.array(np.arange(count)),
                    "task_index": pa.array(np.zeros(count, int)),
                }
            )
        )
    v3 = version.startswith("v3")
    template = (
        "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
        if v3
        else "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    )
    feature = {"dtype": "float64", "shape": [2], "names": names}
    efforts = {**feature, "names": json.loads(json.dumps(names).replace(".pos", ".effort"))}
    info = {
        "codebase_version": version,
        "fps": round(1 / step),
        "total_episodes": len(episodes),
        "chunks_size": 1000,
        "data_path": template,
        "features": {"observation.state": feature, "observation.effort": efforts},
    }
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    if v3:
        papq.write_table(pa.concat_tables(tables), folder / "data" / "chunk-000" / "file-000.parquet")
        about = {"episode_index": list(range(len(tables)))}
        about |= {f"data/{key}": [0] * len(tables) for key in ("chunk_index", "file_index")}
        (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
        papq.write_table(pa.table(about), folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    else:
        for number, table in enumerate(tables):
            papq.write_table(table, folder / "data" / "chunk-000" / f"episode_{number:06d}.parquet")
    return folder


def lists(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """(N, k) as a column of lists."""
    return pa.array(values.tolist(), pa.list_(kind))


def write_lerobot_goals(
    folder: Path, episodes: Sequence[SimpleNamespace], version: str, joints: Sequence[str]
) -> Path:
    """A LeRobot dataset of goals and positions [deg], as teleoperated servo arms are recorded."""
    names = [f"{joint}.pos" for joint in joints]
    degrees = [
        SimpleNamespace(time=e.time, theta=np.degrees(e.theta), tau=np.degrees(e.goal)) for e in episodes
    ]
    out = write_lerobot(folder, degrees, version, names)
    for file in (folder / "data").rglob("*.parquet"):
        table = papq.read_table(file)
        papq.write_table(
            table.rename_columns([{"observation.effort": "action"}.get(n, n) for n in table.column_names]),
            file,
        )
    info = json.loads((folder / "meta" / "info.json").read_text())
    action = info["features"].pop("observation.effort")
    for feature in (action, info["features"]["observation.state"]):
        feature |= {"shape": [len(joints)], "names": names}
    info["features"]["action"] = action
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return out
