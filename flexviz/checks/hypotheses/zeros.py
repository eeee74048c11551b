"""θ of a revolute joint a quarter or half turn further, within its limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS
from flexviz.data.logs import Fix


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
