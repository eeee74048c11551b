"""The unit of angles that are logged with goals and no torque.

Right is the unit in which the joints stay about within their limits and their encoders' counts are alike. In
per cent of a calibrated range counts differ from joint to joint; one that differs alone is in another unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexviz.base.facts import Fact
from flexviz.data.importing.draft import Draft
from flexviz.data.logs import ANGLE
from flexviz.data.measurements import Array, GroupTable
from flexviz.robot.robot import Robot

WITHIN = 0.5  # of its range, by which a joint may be beyond its limits: a servo's zero is set by hand
FULL = 100.0  # per cent of half a range
COUNT = 2 * np.pi / 4096  # [rad] of a servo's encoder
ALIKE = 1.02  # by which counts of one kind may differ
CALIBRATED = 1.41  # by which a calibrated range may differ from the robot description's
FEWEST, FEW = (
    16,
    0.05,
)  # different positions that show a count; share of them, and of a count, that may differ
WIDEST = 4 * np.pi  # [rad] from zero, of a joint without limits


@dataclass(frozen=True)
class GoalUnit:
    """A unit of goals and positions: `size` · number + `zero` is the angle [rad], all (n,)."""

    name: str | None  # None: `size` is stated
    size: Array
    zero: Array
    slack: float = ALIKE  # of the size of a count

    def keys(self, j: int) -> dict[str, str | float]:
        """The keys of a signal of joint j."""
        size = {} if self.name == "rad" else {"unit": self.name or round(float(self.size[j]), 9)}
        return size | ({"offset": round(float(self.zero[j]), 6)} if self.zero[j] else {})


def limits(robot: Robot) -> tuple[Array, Array]:
    """(n,) lower and upper limit [rad]."""
    return np.maximum(robot.lower_limit, -WIDEST), np.minimum(robot.upper_limit, WIDEST)


def known_units(robot: Robot) -> tuple[GoalUnit, ...]:
    """All units, the likeliest first: rad, deg, counts from 0 and about 0, −100 … 100 of the range."""
    lower, upper = limits(robot)
    ones, none = np.ones(robot.n), np.zeros(robot.n)
    return (
        GoalUnit("rad", ones, none),
        GoalUnit("deg", ANGLE["deg"] * ones, none),
        GoalUnit(None, COUNT * ones, none - np.pi),
        GoalUnit(None, COUNT * ones, none),
        GoalUnit(None, (upper - lower) / 2 / FULL, (upper + lower) / 2, CALIBRATED),
    )


def state_units(draft: Draft, robot: Robot, tables: Sequence[GroupTable]) -> bool:
    """Give θ and goal their unit, the same for all joints, and leave joints out that are in another.

    It is left alone where it is stated, or where none fits. Whether anything was changed is returned.
    """
    signals = [draft.joints[joint].signals[name] for joint in draft.joints for name in draft.needed]
    if any("unit" in signal for signal in signals):
        return False
    low = np.min([np.nanmin(t.theta, axis=0) for t in tables], axis=0)
    high = np.max([np.nanmax(t.theta, axis=0) for t in tables], axis=0)
    count = encoder_counts(tables) if robot.n > 1 else np.zeros(1)  # of one joint it tells nothing
    lower, upper = limits(robot)
    room = WITHIN * (upper - lower)

    def alike(unit: GoalUnit, usual: float) -> Array:
        angle = np.where(count > 0, count * unit.size, np.inf)
        return np.abs(np.log(angle / usual)) < np.log(unit.slack)

    def fits(unit: GoalUnit) -> tuple[int, int, int]:
        least, most = low * unit.size + unit.zero, high * unit.size + unit.zero
        inside = (least >= lower - room) & (most <= upper + room)
        certain = inside & alike(unit, COUNT), inside & alike(unit, usual(unit))
        return int(np.sum(certain[0])), int(np.sum(certain[1])), int(np.sum(inside))

    def usual(unit: GoalUnit) -> float:
        """What one count is in this unit [rad]; calibrated ranges do not tell."""
        known = count[count > 0]
        return COUNT if unit.slack > ALIKE or not len(known) else float(np.median(known) * unit.size[0])

    units = [unit for unit in known_units(robot) if unit.zero[0] != -np.pi or low.min() >= 0]
    unit = max(units, key=fits)
    _, certain, inside = fits(unit)
    if not inside:
        return False
    other = (count > 0) & ~alike(unit, usual(unit)) & (certain > max(1, robot.n // 2))
    if unit.slack > ALIKE:  # the encoder knows the calibrated range
        known = (count > 0) & ~other
        unit = replace(unit, size=np.where(known, COUNT / np.where(known, count, 1.0), unit.size))
    for j, joint in enumerate(robot.joints):
        if other[j]:
            draft.leave_out(joint, Fact("other-unit", joints=(joint,)).text)
            continue
        for signal in draft.needed:
            draft.joints[joint].signals[signal] |= unit.keys(j)
            if unit.name != "rad":
                draft.joints[joint].comment(signal, Fact("unit-by-limits").text)
    return unit.name != "rad" or bool(other.any())


def encoder_counts(tables: Sequence[GroupTable]) -> Array:
    """(n,) the count in which each joint's position is recorded, in its own unit; 0 where none shows."""
    positions = np.concatenate([table.theta for table in tables])
    return np.array([encoder_count(np.unique(column)) for column in positions.T])


def encoder_count(values: Array) -> float:
    """The count of which the distances of different, sorted values (N,) are multiples; 0 if they are not."""
    if len(values) < FEWEST:
        return 0.0
    gaps = np.diff(values)
    count = float(np.quantile(gaps, FEW))
    multiples = gaps / count
    on_grid = np.abs(multiples - np.round(multiples)) < FEW
    return count if np.mean(on_grid) > 1 - FEW else 0.0
