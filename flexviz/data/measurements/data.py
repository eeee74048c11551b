"""What a measurement set is made of: groups of uniformly sampled segments, and the hashes of its files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.base.files import named_errors, sha256_of
from flexviz.data.measurements.schema import FILE_NAME
from flexviz.robot.robot import PayloadBody, Robot, is_library_robot

Array = NDArray[Any]  # float64 unless stated otherwise
SPEED_SPAN = 0.02  # [s] over which speeds are averaged: short of a motion, long of the encoder's noise
OPTIONAL_SIGNALS = ("q", "tau_joint", "theta_ref")  # for comparison only


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of one group without gaps, uniformly sampled.

    Attributes:
        time: (N,) the group's own time [s]; time[i] = time[0] + i · step.
        theta: (N, n) motor positions at the joint side [rad].
        tau: (N, n) motor torques at the joint side [Nm].
        step: sampling step [s].
    """

    time: Array
    theta: Array
    tau: Array
    step: float

    def __len__(self) -> int:
        return len(self.time)

    @property
    def mean_speeds(self) -> Array:
        """(N − 2h, n) [rad/s] over `SPEED_SPAN` about the samples from h on, h at least one."""
        half = max(round(SPEED_SPAN / self.step / 2), 1)
        half = min(half, (len(self) - 1) // 2)
        speeds: Array = (self.theta[2 * half :] - self.theta[: -2 * half]) / (2 * half * self.step)
        return speeds


@dataclass(frozen=True, eq=False)
class Group:
    """One trajectory run with one known payload.

    Attributes:
        name, trajectory, payload: as the measurement set calls them.
        bodies: the payload's bodies.
        validation: True when the group is never used for fitting.
        file: the table it was read from.
        segments: the usable stretches, in order.
        time: (N,) every recorded instant [s], as recorded.
        q: (N, n) link-side positions at `time` [rad], or None; NaN for joints without such a column.
        tau_joint: (N, n) measured joint torques at `time` [Nm], or None; NaN likewise.
        theta_ref: (N, n) reference motor positions at `time` [rad], or None; NaN likewise.
        temperature: (n,) of each joint during the run [°C], or None.
        kp_scale: gain of the servos in this run relative to that in others, where joints follow goals.
    """

    name: str
    trajectory: str
    payload: str
    bodies: tuple[PayloadBody, ...]
    validation: bool
    file: Path
    segments: tuple[Segment, ...]
    time: Array
    q: Array | None = None
    tau_joint: Array | None = None
    theta_ref: Array | None = None
    temperature: Array | None = None
    kp_scale: float = 1.0

    @property
    def samples(self) -> int:
        """Number of samples in all segments."""
        return sum(len(segment) for segment in self.segments)

    @property
    def duration(self) -> float:
        """Total length of the segments [s]."""
        return sum(segment.step * (len(segment) - 1) for segment in self.segments)

    def joined(self, name: str) -> Array:
        """time (N,), theta or tau (N, n) over all segments; not copied if there is only one."""
        parts = [getattr(segment, name) for segment in self.segments]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def at(self, name: str, time: Array) -> Array | None:
        """An optional signal ("q", "tau_joint", "theta_ref") at `time` (M,) by linear interpolation."""
        values: Array | None = getattr(self, name)
        if values is None:
            return None
        if len(time) == len(self.time) and np.array_equal(time, self.time):
            return values
        columns = [np.interp(time, self.time, values[:, j]) for j in range(values.shape[1])]
        return np.stack(columns, axis=1)


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


def present_fingerprint(folder: Path, robot: Robot, tables: Iterable[Path]) -> Fingerprint:
    """Hashes of a set's present files; files unchanged since the last call are not read again."""
    return hash_files(folder, description_hash(folder, robot.source, robot.urdf), tables)


def description_hash(folder: Path, source: str, urdf: str) -> FileHash:
    """Hash of a robot's description: its file, or the text of one from a collection."""
    if not is_library_robot(source):
        return _of(folder, source)
    text = urdf.encode()
    return FileHash(source, hashlib.sha256(text).hexdigest(), len(text))


def hash_files(folder: Path, described: FileHash, tables: Iterable[Path]) -> Fingerprint:
    """Hashes of a set's files; `described` is that of its robot."""
    named = (_of(folder, table.relative_to(folder).as_posix()) for table in tables)
    return Fingerprint(tuple(dict.fromkeys((_of(folder, FILE_NAME), described, *named))))


def _of(folder: Path, name: str) -> FileHash:
    file = folder / name
    with named_errors(file, "read"):
        status = file.stat()
        return FileHash(name, _sha256(file, status.st_mtime_ns, status.st_size), status.st_size)


@lru_cache(maxsize=512)
def _sha256(file: Path, changed: int, size: int) -> str:
    return sha256_of(file)
