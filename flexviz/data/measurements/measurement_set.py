"""A measurement set in memory, from files or from arrays."""

from __future__ import annotations

import datetime as dt
import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from flexviz.base.errors import InputError, choose_from
from flexviz.base.facts import Fact
from flexviz.base.hooks import SetChecks
from flexviz.base.names import names_of
from flexviz.base.units import joint_units
from flexviz.data.measurements.array_tables import array_tables
from flexviz.data.measurements.data import Array, Fingerprint, Group, Segment, present_fingerprint
from flexviz.data.measurements.drive import Drive, check_changes
from flexviz.data.measurements.group_reading import (
    check_signals,
    clock_facts,
    copies,
    read_group,
    read_payloads,
    read_robot,
    values,
    without_scraps,
)
from flexviz.data.measurements.holds import HoldGroup
from flexviz.data.measurements.schema import FILE_NAME, MeasurementFile, TorqueSide, parse
from flexviz.data.measurements.segments import Segmented
from flexviz.data.measurements.set_document import SetProperties, set_document
from flexviz.data.measurements.tables import Table
from flexviz.robot.mounting import GRAVITY, checked_gravity
from flexviz.robot.robot import PayloadBody, Robot

NOTHING = "none"  # name of the payload of a group that carries nothing

NO_SAMPLES = Segment(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), 0.0)

log = logging.getLogger("flexviz.data.measurements")


class Warnings(list[Fact]):
    """Oddities found while a set is read."""

    def __init__(self, logged: bool) -> None:
        super().__init__()
        self._logged = logged

    def __call__(self, *facts: Fact) -> None:
        self.extend(facts)
        for fact in facts if self._logged else ():
            log.warning("%s", fact)


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
        groups: all groups of motion, in the file's order.
        holds: static tests.
        simulated: True when a simulator wrote the set (and truth.json beside it).
        warnings: oddities found while reading.
        files_read: hashes of its files when they were read; None if it was not read from files.
        date: of the recording, or None.
        torque: what τ is: "motor", or "joint" if it was measured behind the gears; None: the data decide.
        rigid: joints without elasticity, q = θ.
        no_torque: joints whose τ is no signal and therefore zero here: they move, but it is not fitted.
        drive: servos that follow goals; τ is then how far the goal is ahead [rad]. None: τ was recorded.
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
    warnings: tuple[Fact, ...] = ()
    files_read: Fingerprint | None = None
    date: dt.datetime | dt.date | None = None
    torque: TorqueSide | None = None
    rigid: tuple[str, ...] = ()
    no_torque: tuple[str, ...] = ()
    holds: tuple[HoldGroup, ...] = ()
    drive: Drive | None = None

    @staticmethod
    def from_arrays(
        robot: Robot | str | Path,
        data: Any,
        *,
        name: str = "arrays",
        joints: str | Sequence[str] | None = None,
        validation: str | Collection[str] = (),
        payloads: Mapping[str, Sequence[PayloadBody]] | None = None,
        carried: Mapping[str, str] | None = None,
        **properties: Unpack[SetProperties],
    ) -> MeasurementSet:
        """A measurement set from arrays or DataFrames, checked like one from files.

        A run is a mapping, pandas DataFrame or xarray Dataset with the columns of a set's table: `time` (N,)
        [s], or an index of that name or of dates; `theta_<joint>`, `tau_<joint>` (N,) [rad], [Nm] at the
        joint side, or all joints at once in `theta`, `tau` (N, n); `q`, `tau_joint` and `theta_ref` likewise,
        if known. Arrays are copied.

        Args:
            robot: a `Robot`, a URDF's path, `example-robot-data:<name>` or `robots:<name>`.
            data: one run, or name of each group -> its run.
            name: of the set.
            joints: names of the n joints, the columns' order; None: those of the robot.
            validation: names of the groups that are never fitted.
            payloads: name -> bodies.
            carried: group -> name of its payload; a group that is not named carries nothing.
            properties: of the set, as in its file: see `SetProperties`.

        Raises:
            InputError: naming run, row and column, for anything that a file would be refused for.
        """
        place = Path(name)
        joints, validation = None if joints is None else names_of(joints), names_of(validation)
        gravity = checked_gravity(properties.get("gravity", GRAVITY), f"{name}, gravity")
        if not isinstance(robot, Robot):
            robot = read_robot(str(robot), joints, Path.cwd(), place, gravity)
        elif joints is not None and tuple(joints) != robot.joints:
            message = f"found {', '.join(joints)}, expected those of the robot: {', '.join(robot.joints)}"
            raise InputError(message, file=place, place="joints")
        elif "gravity" in properties:
            robot = robot.mounted(gravity)
        tables = array_tables(data, robot.joints, place)
        carried, bodies = carried or {}, {NOTHING: (), **(payloads or {})}
        for given in (*validation, *carried):
            if given not in tables:
                raise InputError(f'group "{given}" does not exist; {choose_from(given, tables)}', file=place)
        entries = [
            {"name": one, "trajectory": one, "payload": carried.get(one, NOTHING), "file": one}
            | ({"validation": True} if one in validation else {})
            for one in tables
        ]
        content = parse(set_document(robot.source, robot.joints, bodies, entries, **properties), place)
        warn = Warnings(logged=True)
        warn(*(replace(note, file=robot.source) for note in robot.notes))
        checked = read_payloads(content, robot, place)
        read = checked_set(content, robot, checked, list(tables.values()), place, warn)
        return replace(read, files_read=Fingerprint(tuple(table.hash for table in tables.values())))

    @property
    def in_files(self) -> bool:
        """Whether it was read from a folder; otherwise it was made of arrays, and `path` is only a name."""
        if self.files_read is None:
            return (self.path / FILE_NAME).is_file()
        return any(file.name == FILE_NAME for file in self.files_read.files)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def torque_spread(self) -> tuple[float, ...]:
        """Standard deviation of each joint's recorded torque over all groups [Nm]; 0 without a signal."""
        torque = [segment.tau for group in self.groups for segment in group.segments]
        return tuple(map(float, np.std(np.concatenate(torque), axis=0))) if torque else ()

    @property
    def torque_units(self) -> tuple[str, ...]:
        """Unit of each joint's torque, "N" where it slides; empty if all are in Nm; "rad" of goals."""
        if self.drive is not None:
            return joint_units("rad", self.robot.prismatic)
        slides = self.robot.prismatic
        return joint_units("Nm", slides) if slides.any() else ()

    @property
    def seen_limits(self) -> tuple[Any, ...]:
        """Limits at which recorded torques stand, `flexviz.checks.SeenLimit` of the joints that saturate."""
        return SetChecks.seen_limits(self)

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

    def select(self, names: str | Sequence[str] | None = None) -> tuple[tuple[Group, ...], tuple[Group, ...]]:
        """Groups to fit and groups to validate on.

        `names` are the groups to fit (None: all that are not for validation). A group marked as validation is
        always validated on, and asking to fit it is an error.
        """
        fit = self.fit_groups if names is None else tuple(map(self.group, dict.fromkeys(names_of(names))))
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


def fingerprint(measurements: MeasurementSet) -> Fingerprint:
    """Hashes of a set's files when they were read, whatever has become of them since."""
    if measurements.files_read is not None:
        return measurements.files_read
    return present_fingerprint(measurements.path, measurements.robot, _tables(measurements))


def same_recording(one: MeasurementSet, other: MeasurementSet) -> bool:
    """Whether two sets have the same joints, groups and samples, wherever they come from."""
    if one.joints != other.joints or [g.name for g in one.groups] != [g.name for g in other.groups]:
        return False
    segments = ([segment for group in each.groups for segment in group.segments] for each in (one, other))
    return all(
        a.theta.shape == b.theta.shape and np.allclose(a.theta, b.theta) and np.allclose(a.tau, b.tau)
        for a, b in zip_longest(*segments, fillvalue=NO_SAMPLES)
    )


def _tables(measurements: MeasurementSet) -> list[Path]:
    return [group.file for group in (*measurements.groups, *measurements.holds)]


def require_unchanged(measurements: MeasurementSet) -> None:
    """InputError if a file of the set has changed since it was read."""
    now = present_fingerprint(measurements.path, measurements.robot, _tables(measurements))
    if changed := now.changes_since(fingerprint(measurements)):
        message = f"{', '.join(changed)} changed since the set was read; open the set again"
        raise InputError(message, file=measurements.path)


def checked_set(
    content: MeasurementFile,
    robot: Robot,
    payloads: dict[str, tuple[PayloadBody, ...]],
    tables: Sequence[Table],
    file: Path,
    warn: Warnings,
) -> MeasurementSet:
    """The set of a checked `content` with the tables of its groups; `file` is what errors call it."""
    silent = content.model.no_torque
    drive = Drive.of(content.drive, len(content.joints))
    clocks: dict[Path, Segmented] = {}
    groups = tuple(
        read_group(entry, table, robot, payloads[entry.payload], warn, clocks, silent, drive)
        for entry, table in zip(content.groups, tables, strict=True)
        if entry.kind == "motion"
    )
    groups = without_scraps(groups, warn)
    check_signals(groups, file)
    if drive is not None:
        check_changes(groups, content.joints)
    warn(*copies(groups))
    warn(*clock_facts(clocks))
    gains = content.controller
    read = MeasurementSet(
        path=file,
        name=file.name,
        robot=robot,
        joints=tuple(content.joints),
        torque_hold=content.torque_hold,
        initial_stiffness=values(content.initial.stiffness),
        initial_motor_inertia=values(content.initial.motor_inertia),
        kp=values(gains and gains.kp),
        kd=values(gains and gains.kd),
        effects=tuple(content.model.effects),
        payloads=payloads,
        groups=groups,
        warnings=tuple(warn),
        date=content.date,
        torque=content.torque,
        rigid=tuple(content.model.rigid if drive is None else content.joints),  # no goal shows elasticity
        no_torque=tuple(content.model.no_torque),
        drive=drive,
    )
    SetChecks.refuse(read)
    return read
