"""Open a log of any known format, and find the logs that files and folders on a command line stand for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from flexviz.errors import InputError
from flexviz.importing.log import Log, Reading

CSV = (".csv", ".txt", ".tsv", ".dat", ".log")
PARQUET = (".parquet", ".pq")
BAGS = (".mcap", ".db3", ".bag")
SUFFIXES = (*CSV, *PARQUET, *BAGS, ".mat")
KNOWN = "MCAP, ROS 2 bags (a folder or .db3), .bag, CSV, Parquet, .mat and LeRobot datasets"


@dataclass(frozen=True)
class Source:
    """One log to be: a file or folder, and the episode in a dataset of episodes."""

    path: Path
    episode: int | None = None


def open_log(path: Path, reading: Reading) -> Log:
    """Read a log; InputError for whatever cannot be read."""
    return reader_of(path)(path, reading)


def reader_of(path: Path) -> Callable[[Path, Reading], Log]:
    """The reader for a file or folder."""
    try:
        is_folder, exists = path.is_dir(), path.exists()
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot be opened ({getattr(error, 'strerror', None) or error})", file=path
        ) from None
    if not exists:
        raise InputError("file not found", file=path)
    suffix = path.suffix.lower()
    if is_folder:
        if (path / "meta" / "info.json").is_file():
            from flexviz.importing.lerobot import read_episode

            return read_episode
        if (path / "metadata.yaml").is_file():
            from flexviz.importing.bags import read_bag

            return read_bag
        if (path / "measurements.toml").is_file():
            raise InputError(
                "this is a measurement set already: flexviz identify reads it as it is", file=path
            )
        raise InputError(
            "neither a ROS 2 bag (metadata.yaml) nor a LeRobot dataset (meta/info.json)", file=path
        )
    if suffix in BAGS:
        from flexviz.importing.bags import read_bag

        return read_bag
    if suffix == ".mat":
        from flexviz.importing.matlab import read_mat

        return read_mat
    if suffix in PARQUET:
        from flexviz.importing.parquet import read_parquet

        return read_parquet
    if suffix in CSV:
        from flexviz.importing.delimited import read_delimited

        return read_delimited
    raise InputError(f'"{suffix}" is no known format; flexviz import reads {KNOWN}', file=path)


def find_sources(paths: Sequence[Path]) -> list[Source]:
    """The logs that the arguments of a command stand for; a folder of logs stands for all of them."""
    found: list[Source] = []
    for path in paths:
        if (
            path.is_dir()
            and not (path / "metadata.yaml").is_file()
            and not (path / "measurements.toml").is_file()
        ):
            if (path / "meta" / "info.json").is_file():
                from flexviz.importing.lerobot import episodes_of

                found += [Source(path, episode) for episode in episodes_of(path)]
                continue
            inside = sorted(p for p in path.iterdir() if is_log(p))
            if not inside:
                raise InputError(f"the folder holds no log; flexviz import reads {KNOWN}", file=path)
            found += [Source(p) for p in inside]
        else:
            reader_of(path)  # raises where it is none
            found.append(Source(path))
    for i, source in enumerate(found):
        if source in found[:i]:
            raise InputError("is given twice, once would be right", file=source.path)
    return found


def is_log(path: Path) -> bool:
    """Whether something in a folder is taken for a log."""
    if path.name.startswith("."):
        return False
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    return path.suffix.lower() in SUFFIXES
