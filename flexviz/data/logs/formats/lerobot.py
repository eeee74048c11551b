"""LeRobot datasets (v2.x and v3.x): Parquet tables beside meta/info.json, one log per episode.

v2 has one file per episode, v3 puts many episodes into one file. Frames are equally spaced by 1/fps, and
`timestamp` is stored as float32: the time is frame_index / fps, checked against it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq

from flexviz.base.errors import InputError
from flexviz.base.files import named_errors
from flexviz.base.limits import read_json
from flexviz.data.logs.formats.base import SHORTEST, Log, LogFormat, LogTable, ReadOptions, check_stop
from flexviz.data.logs.formats.parquet import check_parquet, columns_of, holds_numbers
from flexviz.data.measurements import readable

INFO = Path("meta") / "info.json"
TIME = "time"  # the column made from frame_index and fps
MOST_EPISODES = 1_000_000
BOOKKEEPING = ("index", "episode_index", "task_index", "frame_index")


def read_info(folder: Path) -> dict[str, Any]:
    """meta/info.json, with the keys that are used here checked."""
    file = folder / INFO
    with named_errors(file, "read"):
        info = read_json(file)
    if not isinstance(info, dict):
        raise InputError("holds no table, expected LeRobot's meta/info.json", file=file)
    version = str(info.get("codebase_version", ""))
    if not version.lstrip("v").startswith(("2", "3")):
        found = f'"{version}"' if version else "nothing"
        message = f"found {found}, expected v2.x or v3.x (LeRobot converts older datasets)"
        raise InputError(message, file=file, place="codebase_version")
    fps, features = info.get("fps"), info.get("features")
    if not isinstance(fps, int | float) or isinstance(fps, bool) or not 0 < fps < 1e6:
        raise InputError(f"found {fps!r}, expected frames per second", file=file, place="fps")
    if not isinstance(features, dict) or not all(isinstance(f, dict) for f in features.values()):
        raise InputError("the table of features is missing", file=file, place="features")
    return info


def episodes_of(folder: Path) -> list[int]:
    """The numbers of all episodes."""
    total = read_info(folder).get("total_episodes")
    if not isinstance(total, int) or isinstance(total, bool) or not 1 <= total <= MOST_EPISODES:
        message = f"found {total!r}, expected the number of episodes, at most {MOST_EPISODES:,}"
        raise InputError(message, file=folder / INFO, place="total_episodes")
    return list(range(total))


def read_episode(folder: Path, options: ReadOptions) -> Log:
    """One episode of a dataset."""
    info = read_info(folder)
    episode = options.episode
    if episode is None:
        last = episodes_of(folder)[-1]
        raise InputError(f"which episode? expected episode = 0 … {last}", file=folder)
    frames = read_frames(folder, episode, options)
    check_stop(options.should_stop)
    if frames.num_rows < SHORTEST:
        message = f"{frames.num_rows} frames, expected at least {SHORTEST}"
        raise InputError(message, file=folder, place=f"episode {episode}")
    columns, units, unusable = columns_of(frames, entry_names(info))
    notes = []
    fps = float(info["fps"])
    number = columns["frame_index"] if "frame_index" in columns else np.arange(frames.num_rows)
    time = (number - number[0]) / fps
    if "timestamp" in columns:
        stamp = np.asarray(columns.pop("timestamp"), dtype=float)
        stamp -= stamp[0]
        if np.max(np.abs(stamp - time)) > 0.1 / fps:
            notes.append("the frames are not spaced by 1/fps: the column timestamp is used")
            time = stamp
    columns = {name: values for name, values in columns.items() if name not in BOOKKEEPING}
    table = LogTable("", {TIME: time, **columns}, TIME, {**units, TIME: "s"})
    return Log(folder, f"LeRobot episode {episode}", (table,), unusable, tuple(notes))


def entry_names(info: dict[str, Any]) -> dict[str, list[str]]:
    """Feature -> names of its entries: a list, or a list under any one key ({"motors": [...]}), or none."""
    found: dict[str, list[str]] = {}
    for feature, about in info["features"].items():
        names = about.get("names")
        if isinstance(names, dict) and len(names) == 1:
            names = next(iter(names.values()))
        if isinstance(names, list) and all(isinstance(name, str) for name in names):
            found[feature] = names if len(set(names)) == len(names) else []
    return found


def read_frames(folder: Path, episode: int, options: ReadOptions) -> pa.Table:
    """The frames of an episode: row groups of other episodes are skipped by their statistics."""
    files = sorted((folder / "data").glob("*/*.parquet"))
    if not files:
        raise InputError("no table data/chunk-*/*.parquet (are they only links to a cache?)", file=folder)
    files = [file for file in files if file.stem == f"episode_{episode:06d}"] or files
    with readable(files[0] if len(files) == 1 else folder / "data", "Parquet table"):
        schema = papq.read_schema(files[0])
        names = [field.name for field in schema if holds_numbers(field.type) and options.wants(field.name)]
        names += [x for x in ("timestamp", "frame_index", "episode_index") if x in {*schema.names} - {*names}]
        for file in files:
            check_parquet(file, names)
        own = [("episode_index", "=", episode)] if "episode_index" in schema.names else None
        return papq.read_table(files, columns=names, filters=own)


LEROBOT = LogFormat(
    "LeRobot datasets", read_episode, folder="a LeRobot dataset", mark=str(INFO), episodes=episodes_of
)
