"""Columns in a unit that is orders of magnitude off: no measurement set may have them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.checks.columns import check_optional_columns
from flexviz.checks.groups import check_groups
from flexviz.checks.issues import Issue
from flexviz.checks.rigid import Comparison, LoadedTable
from flexviz.checks.set_samples import spoilt_group
from flexviz.checks.sets import stated_mapping
from flexviz.checks.thresholds import LIMITS
from flexviz.data.measurements import Group, GroupTable, MeasurementSet
from flexviz.robot.robot import Robot

# times: the smallest step between two units that are in use, and to the orders of magnitude of others
APART = float(np.degrees(1.0)) / LIMITS.agrees


def refuse_wrong_units(measurements: MeasurementSet) -> None:
    """Compare each group by itself with the robot.

    Raises:
        InputError: naming file and column, if a unit is surely wrong by `APART` or more.
    """
    for group in measurements.groups:
        for issue in wrong_units(measurements.robot, group, measurements.drive is None):
            text = Fact("wrong-unit", "wrong", values={"issue": issue}).text
            raise InputError(text, file=group.file, place=f"column {issue.signal}_{issue.joints[0]}")


def wrong_units(robot: Robot, group: Group, torques: bool = True) -> Iterator[Issue]:
    """Units of a group that are surely wrong by orders of magnitude; of angles alone without `torques`."""
    mapping, table = stated_mapping(robot), GroupTable.of(group)
    if not torques:
        table = replace(table, tau=np.zeros_like(table.tau))
    with threadpool_limits(1, "blas"):  # the matrices are small: threads would wait for each other
        if not check_optional_columns(mapping, [table]) and not doubtful(robot, [(group.bodies, table)]):
            return
        found = check_groups(mapping, robot, [(group.bodies, table)])
    for issue in found:
        if issue.kind != "unit" or issue.severity != "wrong":
            continue
        if "span" in issue.values:  # all that is known is that it leaves its limits, unless it jumps
            if issue.values["times"] > LIMITS.far_beyond and not spoilt_group(group, robot):
                yield issue
        elif abs(np.log(abs(issue.values["times"]))) > np.log(APART):
            yield issue


def doubtful(robot: Robot, groups: Sequence[LoadedTable]) -> bool:
    """Whether angles leave the joints' limits, or a torque is more probable with any other size."""
    few = Comparison(robot, groups).few
    return not few.usable or bool(np.any(few.beyond(few.stated))) or few.doubts_size
