"""θ of a revolute joint a quarter or half turn further, within its limits; in one log or all by any angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.left import Estimated, estimated, remainders
from flexviz.checks.reading import Reading
from flexviz.checks.rigid import Comparison
from flexviz.checks.thresholds import LIMITS, SURE
from flexviz.data.logs import Fix

STEP = 1e-4  # [rad] by which a zero is turned for a derivative
STEPS = 2  # of the angle, after its estimate


@hypothesis
def zeros(case: Case) -> Iterator[Fault]:
    robot, now = case.comparison.robot, case.now
    recorded = case.comparison.angles(now)
    for j, quarter in product(map(int, np.flatnonzero(~robot.prismatic)), (1, -1, 2)):
        turned = case.at((j,), quarter * np.pi / 2, 0.0)
        before, after = float(now.zero[0, j]), float(now.zero[0, j] + turned[j])
        q = recorded[:, j]
        limits = robot.lower_limit[j] - LIMITS.zero, robot.upper_limit[j] + LIMITS.zero
        inside = [np.min(x) > limits[0] and np.max(x) < limits[1] for x in (q + before, q + after)]
        if inside[0] and not inside[1]:
            continue
        joint = case.mapping.names[j]
        offset = round(case.mapping.joints[joint].theta.offset + after, 6)

        def moved(reading: Reading, by: np.ndarray = turned) -> Reading:
            return replace(reading, zero=reading.zero + by)

        fix = Fix(joint, "theta", "offset", offset)
        yield Fault("zero", (j,), "theta", moved, f"{quarter}", (fix,))


@hypothesis
def turned(case: Case) -> Iterator[Fault]:
    """The zero of one joint in one group, as after a belt has slipped; or in all of them.

    A base that is not quite level looks like the latter: what is small is not told, but explains.
    """
    groups = tuple(enumerate(case.comparison.names))
    if case.now.drive is not None:
        return
    start = _Turning(case.comparison, case.now)
    for j in map(int, np.flatnonzero(~case.comparison.robot.prismatic)):
        slope = start.slope(j)
        for g, name in ((-1, ""), *(groups if len(groups) > 1 else ())):
            rows = case.comparison.rows_of(g) if name else slice(None)
            found = start.angle(slope, rows)
            known = float(np.log(min(found.std / np.pi, 1.0)))
            large = LIMITS.smallest_motion < abs(found.size) < np.pi / 4
            if not large or found.gain + known < SURE - np.log(LIMITS.fault):
                continue
            here = case.at((j,), 1.0, 0.0)
            here, angle = case.of_group(g, here, 0.0) if name else here, found.size
            for _ in range(STEPS):
                there = _Turning(case.comparison, replace(case.now, zero=case.now.zero + angle * here))
                angle += there.angle(there.slope(j), rows).size

            def moved(reading: Reading, by: np.ndarray = angle * here) -> Reading:
                return replace(reading, zero=reading.zero + by)

            values = {"angle": angle, **({"groups": (name,)} if name else {})}
            values |= {"untold": True} if not name and abs(angle) < LIMITS.zero else {}
            where = (g,) if name else ()
            yield Fault("zero", (j,), "theta", moved, f"any{name}", open=known, values=values, groups=where)


class _Turning:
    """What turned zeros explain of the torques that a reading leaves."""

    def __init__(self, comparison: Comparison, now: Reading) -> None:
        self.comparison, self.now = comparison, now
        self.columns, self.left = comparison.columns(now), remainders(comparison, now)

    def slope(self, j: int) -> Array:
        """(M, n) by which all torques of the masses change with a joint's zero [Nm/rad]."""
        there = self.now.zero + STEP * (np.arange(self.comparison.robot.n) == j)
        both = zip(self.comparison.columns(replace(self.now, zero=there)), self.columns, strict=True)
        return np.stack([np.sum(a.masses - b.masses, axis=1) / STEP for a, b in both], axis=1)

    def angle(self, slope: Array, rows: slice | Bools) -> Estimated:
        """The angle by which a zero is off in these rows (M,)."""
        column = np.zeros_like(slope)
        column[rows] = slope[rows]
        column -= np.mean(column, axis=0)
        return estimated(self.left, self.comparison.slow.T @ column)
