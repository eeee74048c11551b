"""What `measurements.toml` says about a set, and the hashes of its files, without reading its tables."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from flexviz.base import toml
from flexviz.data.measurements.data import FileHash, Fingerprint, description_hash, hash_files
from flexviz.data.measurements.reading import inside
from flexviz.data.measurements.schema import locate, parse
from flexviz.robot.robot import Robot, is_library_robot


@dataclass(frozen=True)
class SetOverview:
    """A set that was not read.

    Attributes:
        path: the set's folder.
        date: of the recording, or None.
        joints: their names.
        robot: file of its description, or its name in a collection.
        description: hash of that description.
        files: hashes of all files, as `read_set` takes them.
        changed: when a file of the set was changed last [s since 1970].
    """

    path: Path
    date: dt.datetime | dt.date | None
    joints: tuple[str, ...]
    robot: str
    description: FileHash
    files: Fingerprint
    changed: float


def overview(path: str | Path) -> SetOverview:
    """The overview of the set in the folder `path`; InputError if it cannot be given."""
    file = locate(path)
    content = parse(toml.read(file), file)
    folder = file.resolve().parent
    if is_library_robot(content.robot):
        described = _of_collection(content.robot, tuple(content.joints))
    else:
        inside(folder, content.robot, file, "robot")
        described = description_hash(folder, content.robot, "")
    places = [(g.file, f'group {i} "{g.name}", file') for i, g in enumerate(content.groups, 1)]
    tables = [inside(folder, name, file, place) for name, place in places]
    files = hash_files(folder, described, tables)
    changed = max(table.stat().st_mtime for table in tables)
    joints = tuple(content.joints)
    return SetOverview(folder, content.date, joints, content.robot, described, files, changed)


@lru_cache(maxsize=64)
def _of_collection(source: str, joints: tuple[str, ...]) -> FileHash:
    return description_hash(Path(), source, Robot.load(source, joints).urdf)
