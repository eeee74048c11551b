"""The unit of angles that are logged with goals and no torque: what fits into the joints' ranges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.facts import Fact
from flexviz.data.importing.draft import Draft
from flexviz.data.logs import ANGLE
from flexviz.data.measurements import Array, GroupTable
from flexviz.robot.robot import Robot

WITHIN = 0.05  # of its range, by which a joint may be beyond its limits
FULL = 100.0  # per cent of half a range


def state_units(draft: Draft, robot: Robot, tables: Sequence[GroupTable]) -> None:
    """Give θ and goal the unit in which all joints stay within their limits; radians come first.

    The unit is one for all joints, and the same of angle and goal. It is left alone where it is stated, or
    where none fits.
    """
    signals = [draft.joints[joint].signals[name] for joint in draft.joints for name in draft.needed]
    if any("unit" in signal for signal in signals):
        return
    low = np.min([np.nanmin(t.theta, axis=0) for t in tables], axis=0)
    high = np.max([np.nanmax(t.theta, axis=0) for t in tables], axis=0)
    room = WITHIN * (robot.upper_limit - robot.lower_limit)
    half, middle = (robot.upper_limit - robot.lower_limit) / 2, (robot.upper_limit + robot.lower_limit) / 2
    ones, zero = np.ones(robot.n), np.zeros(robot.n)
    units: list[tuple[str, Array, Array]] = [
        ("rad", ones, zero),
        ("deg", ANGLE["deg"] * ones, zero),
        ("", half / FULL, middle),
        ("", 2 * np.pi / 4096 * ones, np.where(low >= 0, -np.pi, 0.0)),
    ]
    for unit in units:
        name, size, offset = unit
        least, most = low * size + offset, high * size + offset
        if np.all((least >= robot.lower_limit - room) & (most <= robot.upper_limit + room)):
            break
    else:
        return
    for j, joint in enumerate(draft.joints):
        for signal in draft.needed:
            table = draft.joints[joint].signals[signal]
            if name != "rad":
                table["unit"] = name or round(float(size[j]), 9)
            if offset[j]:
                table["offset"] = round(float(offset[j]), 6)
            if name != "rad":
                draft.joints[joint].comment(signal, Fact("unit-by-limits").text)
