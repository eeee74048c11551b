"""A measurement set in memory: groups of uniformly sampled segments, and the hashes of its files."""

from __future__ import annotations

import datetime as dt
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError, choose_from
from flexviz.files import named_errors, sha256_of
from flexviz.measurements.schema import FILE_NAME
from flexviz.robot import PayloadBody, Robot, is_library_robot

Array = NDArray[Any]  # float64 unless stated otherwise
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


@dataclass(frozen=True, eq=False)
class MeasurementSet:
    """A robot, its groups, and rough start values of its joints (n joints, in the set's order).

    Attributes:
        path: the set's folder.
        name: its name (the folder's).
        robot: the robot, reduced to `joints`.
        joints: names of the n joints; the order of every list and column.
        torque_hold: h [s]: a torque is sampled at the start of a hold of h, so τ(t − h/2) acts.
        initial_stiffness: (n,) rough stiffness [Nm/rad], or None.
        initial_motor_inertia: (n,) rough motor inertia at the joint side [kg m²], or None.
        kp, kd: (n,) the controller's gains [Nm/rad], [Nm s/rad], or None.
        effects: names of the effects the model starts with, on every joint.
        payloads: name -> bodies.
        groups: all groups, in the file's order.
        simulated: True when a simulator wrote the set (and truth.json beside it).
        warnings: oddities found while reading, one line each.
        files_read: hashes of its files when they were read; None if it was not read from files.
        date: of the recording, or None.
    """

    path: Path
    name: str
    robot: Robot
    joints: tuple[str, ...]
    torque_hold: float
    initial_stiffness: Array | None
    initial_motor_inertia: Array | None
    kp: Array | None
    kd: Array | None
    effects: tuple[str, ...]
    payloads: dict[str, tuple[PayloadBody, ...]]
    groups: tuple[Group, ...]
    simulated: bool = False
    warnings: tuple[str, ...] = ()
    files_read: Fingerprint | None = None
    date: dt.datetime | dt.date | None = None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def torque_spread(self) -> tuple[float, ...]:
        """Standard deviation of each joint's recorded torque over all groups [Nm]."""
        torque = [segment.tau for group in self.groups for segment in group.segments]
        return tuple(map(float, np.std(np.concatenate(torque), axis=0))) if torque else ()

    @property
    def fit_groups(self) -> tuple[Group, ...]:
        """Groups that may be fitted."""
        return tuple(group for group in self.groups if not group.validation)

    @property
    def validation_groups(self) -> tuple[Group, ...]:
        """Groups that are never used for fitting."""
        return tuple(group for group in self.groups if group.validation)

    @property
    def carried(self) -> tuple[str, ...]:
        """Names of the payloads that are not empty."""
        return tuple(name for name, bodies in self.payloads.items() if bodies)

    def group(self, name: str) -> Group:
        """The group called `name`; InputError listing the valid names when there is none."""
        for group in self.groups:
            if group.name == name:
                return group
        raise InputError(
            f'group "{name}" does not exist; {choose_from(name, [g.name for g in self.groups])}',
            file=self.path,
        )

    def select(self, names: Sequence[str] | None = None) -> tuple[tuple[Group, ...], tuple[Group, ...]]:
        """Groups to fit and groups to validate on.

        `names` are the groups to fit (None: all that are not for validation). A group marked as validation is
        always validated on, and asking to fit it is an error.
        """
        fit = self.fit_groups if names is None else tuple(dict.fromkeys(self.group(name) for name in names))
        for group in fit:
            if group.validation:
                valid = choose_from(group.name, [g.name for g in self.fit_groups])
                message = f'group "{group.name}" is for validation, never for fitting; {valid}'
                raise InputError(message, file=self.path)
        if not fit:
            why = "every group is marked as validation" if names is None else "no group was named"
            raise InputError(f"there is no group to fit: {why}, expected at least one", file=self.path)
        return fit, self.validation_groups

    def joint_index(self, joint: str) -> int:
        """Position of `joint` in every list; InputError listing the valid names when it is not in the set."""
        if joint not in self.joints:
            message = f'joint "{joint}" is not in the set; {choose_from(joint, self.joints)}'
            raise InputError(message, file=self.path)
        return self.joints.index(joint)


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
    """Hashes of a set's files when they were read, whatever has become of them since."""
    if measurements.files_read is not None:
        return measurements.files_read
    return present_fingerprint(measurements.path, measurements.robot, [g.file for g in measurements.groups])


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


def require_unchanged(measurements: MeasurementSet) -> None:
    """InputError if a file of the set has changed since it was read."""
    tables = [group.file for group in measurements.groups]
    now = present_fingerprint(measurements.path, measurements.robot, tables)
    if changed := now.changes_since(fingerprint(measurements)):
        message = f"{', '.join(changed)} changed since the set was read; open the set again"
        raise InputError(message, file=measurements.path)


def _of(folder: Path, name: str) -> FileHash:
    file = folder / name
    with named_errors(file, "read"):
        status = file.stat()
        return FileHash(name, _sha256(file, status.st_mtime_ns, status.st_size), status.st_size)


@lru_cache(maxsize=512)
def _sha256(file: Path, changed: int, size: int) -> str:
    return sha256_of(file)
