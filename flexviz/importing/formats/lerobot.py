"""LeRobot datasets (v2.x and v3.x): Parquet tables beside meta/info.json, one log per episode.

v2 has one file per episode, named by `data_path` in info.json; v3 puts many episodes into one file, and
meta/episodes says which. A recording's frames are equally spaced by 1/fps, and `timestamp` is stored as
float32: the time is frame_index / fps, checked against it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq

from flexviz.errors import InputError
from flexviz.importing.formats.base import SHORTEST, Log, LogFormat, LogTable, ReadOptions, readable
from flexviz.importing.formats.parquet import columns_of, holds_numbers
from flexviz.progress import Progress

INFO = Path("meta") / "info.json"
TIME = "time"  # the column made from frame_index and fps
BOOKKEEPING = ("index", "episode_index", "task_index", "frame_index")


def read_info(folder: Path) -> dict[str, Any]:
    """meta/info.json, with the keys that are used here checked."""
    file = folder / INFO
    try:
        info = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as JSON ({error})", file=file) from None
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
    info = read_info(folder)
    total = info.get("total_episodes")
    if not isinstance(total, int) or isinstance(total, bool) or total < 1:
        message = f"found {total!r}, expected the number of episodes"
        raise InputError(message, file=folder / INFO, place="total_episodes")
    return list(range(total))


def read_episode(folder: Path, options: ReadOptions) -> Log:
    """One episode of a dataset."""
    info = read_info(folder)
    episode = options.episode
    if episode is None:
        last = episodes_of(folder)[-1]
        raise InputError(f"which episode? expected episode = 0 … {last}", file=folder)
    parts = []
    for file in files_of(folder, info, episode):
        options.check_stop()
        options.progress(Progress(f"reading {folder.name}, episode {episode}", 0.0))
        parts.append(read_part(file, episode, options))
    frames = pa.concat_tables(parts, promote_options="permissive")
    if frames.num_rows < SHORTEST:
        message = f"{frames.num_rows} frames, expected at least {SHORTEST}"
        raise InputError(message, file=folder, place=f"episode {episode}")
    columns, units, unusable = columns_of(frames, entry_names(info))
    notes = []
    fps = float(info["fps"])
    number = np.asarray(columns.get("frame_index", np.arange(frames.num_rows)))
    time = (number - number[0]) / fps
    stamp = columns.pop("timestamp", None)
    if stamp is not None:
        stamp = np.asarray(stamp, dtype=float) - float(stamp[0])
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
            found[feature] = [str(name) for name in names] if len(set(names)) == len(names) else []
    return found


def files_of(folder: Path, info: dict[str, Any], episode: int) -> list[Path]:
    """The tables that may hold frames of an episode."""
    template = str(info.get("data_path") or "")
    values = {
        "episode_index": episode,
        "episode_chunk": episode // max(1, int(info.get("chunks_size") or 1000)),
    }
    for file in sorted((folder / "meta" / "episodes").glob("*/*.parquet")):
        with readable(file, "Parquet table"):
            about = papq.read_table(file, filters=[("episode_index", "=", episode)])
            if about.num_rows and {"data/chunk_index", "data/file_index"} <= set(about.column_names):
                values |= {key: about[f"data/{key}"][0].as_py() for key in ("chunk_index", "file_index")}
    try:
        named = folder / template.format(**values)
    except (KeyError, ValueError, IndexError):
        named = folder / "data"
    if template and named.is_file() and folder.resolve() in named.resolve().parents:
        return [named]
    every = sorted((folder / "data").glob("*/*.parquet"))
    if not every:
        raise InputError("no table data/chunk-*/*.parquet (are they only links to a cache?)", file=folder)
    own = [file for file in every if file.stem == f"episode_{episode:06d}"]
    return own or every


def read_part(file: Path, episode: int, options: ReadOptions) -> pa.Table:
    """The frames of the episode in one file."""
    with readable(file, "Parquet table"):
        schema = papq.read_schema(file)
        names = [field.name for field in schema if holds_numbers(field.type) and options.wants(field.name)]
        names += [x for x in ("timestamp", "frame_index", "episode_index") if x in {*schema.names} - {*names}]
        own = [("episode_index", "=", episode)] if "episode_index" in schema.names else None
        return papq.read_table(file, columns=names, filters=own)


LEROBOT = LogFormat(
    "LeRobot datasets", read_episode, folder="a LeRobot dataset", mark=str(INFO), episodes=episodes_of
)
