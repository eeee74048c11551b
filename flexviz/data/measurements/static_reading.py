"""Read the static tests of a measurement set."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from flexviz.base.facts import Fact
from flexviz.data.measurements.holds import SHORTEST_HOLD, HoldGroup, find_holds
from flexviz.data.measurements.schema import GroupEntry, MeasurementFile, clamped_joints
from flexviz.data.measurements.segments import check_time
from flexviz.data.measurements.tables import column_names, read_columns, require
from flexviz.robot.robot import PayloadBody, Robot


def static_tests(
    content: MeasurementFile,
    paths: Sequence[Path],
    robot: Robot,
    payloads: Mapping[str, tuple[PayloadBody, ...]],
    warn: Callable[[Fact], None],
) -> tuple[HoldGroup, ...]:
    """The static tests of a set; `paths` are its tables."""
    silent = content.model.no_torque
    return tuple(
        read_holds(entry, table, robot, payloads[entry.payload], silent, warn)
        for entry, table in zip(content.groups, paths, strict=True)
        if entry.kind == "holds"
    )


def read_holds(
    entry: GroupEntry,
    file: Path,
    robot: Robot,
    bodies: tuple[PayloadBody, ...],
    no_torque: Sequence[str],
    warn: Callable[[Fact], None],
) -> HoldGroup:
    """Read a static test: a recording, of which the rests count, or a table with one row per hold.

    A column `approach_<joint>` says from which side the motor came, 1 or −1, or 0 where it did not move.
    """
    present, joints, n = column_names(file), robot.joints, robot.n
    needed = [f"theta_{joint}" for joint in joints]
    needed += [f"tau_{joint}" for joint in joints if joint not in no_torque]
    require(present, ["time", *needed], file)
    stated = [f"approach_{joint}" for joint in joints]
    stated = stated if set(stated) <= set(present) else []
    table = read_columns(file, ["time", *needed, *stated])
    check_time(table[:, 0], file)
    tau = np.zeros((len(table), n))
    sensed = [j for j, joint in enumerate(joints) if joint not in no_torque]
    tau[:, sensed] = table[:, 1 + n : 1 + n + len(sensed)]
    holds = find_holds(table[:, 0], table[:, 1 : 1 + n], tau, table[:, -n:] if stated else None)
    names = clamped_joints(entry.clamped, joints)
    if not holds.count:
        warn(Fact("no-rest", "odd", values={"least": SHORTEST_HOLD}, file=str(file)))
    clamped = np.array([joint in names for joint in joints])
    return HoldGroup(entry.name, entry.payload, bodies, file, holds, clamped)
