"""What is written of a set in memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.files import named_errors, sha256_of
from flexviz.base.schemas import first_repeated
from flexviz.data.measurements.group_table import GroupTable
from flexviz.data.measurements.measurement_set import MeasurementSet
from flexviz.data.measurements.reading import TRUTH
from flexviz.data.measurements.robot_in_set import robot_files
from flexviz.data.measurements.set_document import SetProperties


@dataclass(frozen=True, eq=False)
class SetContents:
    """Parts of a set, as `write_set` takes them.

    Attributes:
        robot: its name in the set.
        groups: motions, then static tests.
        files: further files of the set: description and meshes of the robot, the mark of simulated sets.
        properties: of robot and recording.
    """

    robot: str
    groups: tuple[GroupTable, ...]
    files: dict[str, str | bytes | Path]
    properties: SetProperties


def contents_of(measurements: MeasurementSet) -> SetContents:
    """The parts of a set in memory; InputError if the table of a static test has changed."""
    one = measurements
    robot, files, _ = robot_files(one.robot)
    if one.simulated and (truth := one.path / TRUTH).is_file():
        files[TRUTH] = truth
    for hold in one.holds:
        require_read(one, hold.file)
    groups = [GroupTable.of(group) for group in one.groups]
    groups += [GroupTable.of_holds(group, one.joints) for group in one.holds]
    if one.drive is not None:  # its table has goals and no torque
        groups = [replace(group, tau=np.full_like(group.tau, np.nan)) for group in groups]
    if first_repeated(group.file for group in groups if group.file):  # of several folders
        groups = [replace(group, file=None) for group in groups]
    properties = SetProperties(
        gravity=one.robot.gravity, torque_hold=one.torque_hold, initial_stiffness=one.initial_stiffness,
        initial_motor_inertia=one.initial_motor_inertia, kp=one.kp, kd=one.kd, effects=one.effects,
        date=one.date, torque=one.torque, rigid=one.rigid, no_torque=one.no_torque,
        drive=one.drive and one.drive.document(),
    )  # fmt: skip
    return SetContents(robot, tuple(groups), files, properties)


def require_read(measurements: MeasurementSet, file: Path) -> None:
    """InputError unless a table is still what was read."""
    known = measurements.files_read.files if measurements.files_read is not None else ()
    with named_errors(file, "copied"):
        if known and sha256_of(file) not in {one.sha256 for one in known}:
            raise InputError("changed since the set was read; read the set again", file=file)
