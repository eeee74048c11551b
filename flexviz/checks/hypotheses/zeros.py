"""θ of a revolute joint a quarter or half turn further, within its limits; or in one log by any angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from flexviz.base.arrays import Array
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
def of_one_log(case: Case) -> Iterator[Fault]:
    """The zero of one joint in one group: another one than before, as after a belt has slipped."""
    if len(case.comparison.names) < 2 or case.now.drive is not None:
        return
    for j in map(int, np.flatnonzero(~case.comparison.robot.prismatic)):
        slope = _slope(case.comparison, case.now, j)
        for g, name in enumerate(case.comparison.names):
            found = _turn(case.comparison, case.now, g, slope)
            prior = float(np.log(min(found.std / np.pi, 1.0)))
            large = LIMITS.smallest_motion < abs(found.size) < np.pi / 4
            if not large or found.gain + prior < SURE - np.log(LIMITS.fault):
                continue
            here, angle = case.of_group(g, case.at((j,), 1.0, 0.0), 0.0), found.size
            for _ in range(STEPS):
                now = replace(case.now, zero=case.now.zero + angle * here)
                angle += _turn(case.comparison, now, g, _slope(case.comparison, now, j)).size

            def moved(reading: Reading, by: np.ndarray = angle * here) -> Reading:
                return replace(reading, zero=reading.zero + by)

            values = {"groups": (name,), "angle": angle}
            yield Fault("zero", (j,), "theta", moved, name, prior=prior, values=values, groups=(g,))


def _slope(comparison: Comparison, now: Reading, j: int) -> Array:
    """(M, n) by which all torques of the masses change with a joint's zero [Nm/rad]."""
    there = now.zero + STEP * (np.arange(comparison.robot.n) == j)
    both = zip(comparison.columns(replace(now, zero=there)), comparison.columns(now), strict=True)
    return np.stack([np.sum(a.masses - b.masses, axis=1) / STEP for a, b in both], axis=1)


def _turn(comparison: Comparison, now: Reading, group: int, slope: Array) -> Estimated:
    """The angle by which a zero is off in one group."""
    column = np.where(comparison.rows_of(group)[:, None], slope, 0.0)
    column -= np.mean(column, axis=0)
    return estimated(remainders(comparison, now), comparison.slow.T @ column)
