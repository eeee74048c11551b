"""SHA-256 of every file that a measurement set consists of."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from flexviz.errors import InputError
from flexviz.files import sha256_of
from flexviz.measurements.data import MeasurementSet
from flexviz.measurements.schema import FILE_NAME
from flexviz.robot import is_library_robot


@dataclass(frozen=True)
class FileHash:
    """One file of a set."""

    name: str  # relative to the set's folder; for a robot from a collection its name there
    sha256: str  # of the content, hexadecimal
    bytes: int  # its size


@dataclass(frozen=True)
class Fingerprint:
    """All files of a set: `measurements.toml`, the robot's description, the tables."""

    files: tuple[FileHash, ...]

    @property
    def sha256(self) -> str:
        """One hash for all: of the lines `<sha256>  <name>`, sorted by name."""
        lines = "".join(f"{f.sha256}  {f.name}\n" for f in sorted(self.files, key=lambda f: f.name))
        return hashlib.sha256(lines.encode()).hexdigest()

    def changes_since(self, before: Fingerprint) -> tuple[str, ...]:
        """Names of changed, missing and new files, in the older order."""
        then, now = ({f.name: f.sha256 for f in side.files} for side in (before, self))
        return tuple(name for name in dict.fromkeys((*then, *now)) if then.get(name) != now.get(name))


def fingerprint(measurements: MeasurementSet) -> Fingerprint:
    """Hashes of a set's files; files unchanged since the last call are not read again."""
    folder, robot = measurements.path, measurements.robot
    tables = [group.file.relative_to(folder).as_posix() for group in measurements.groups]
    if is_library_robot(robot.source):
        text = robot.urdf.encode()
        described = FileHash(robot.source, hashlib.sha256(text).hexdigest(), len(text))
    else:
        described = _of(folder, robot.source)
    files = [_of(folder, FILE_NAME), described, *(_of(folder, name) for name in tables)]
    return Fingerprint(tuple(dict.fromkeys(files)))


def _of(folder: Path, name: str) -> FileHash:
    file = folder / name
    try:
        status = file.stat()
        return FileHash(name, _sha256(file, status.st_mtime_ns, status.st_size), status.st_size)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=file) from None


@lru_cache(maxsize=512)
def _sha256(file: Path, changed: int, size: int) -> str:
    return sha256_of(file)
