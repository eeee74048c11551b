"""A torque whose zero drifts over each log, as that of a sensor or amplifier that gets warm."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.left import remainders
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS, SURE

LEAST = 0.1  # of the torque's standard deviation: a smaller drift is none of the sensor


@hypothesis
def drifts(case: Case) -> Iterator[Fault]:
    comparison, now = case.comparison, case.now
    ramps = comparison.ramps - np.mean(comparison.ramps, axis=0)
    low = comparison.slow.T @ ramps
    for j, left in enumerate(remainders(comparison, now)):
        if left is None or now.drifts[j]:
            continue
        new = left.new(low)
        found = np.linalg.lstsq(new, left.torque, rcond=1e-9)[0]
        rest = left.torque - new @ found
        power = left.power - float(left.torque @ left.torque) + float(rest @ rest)
        cost = 0.5 * len(found) * np.log(left.swings)  # of so many numbers
        gain = 0.5 * left.swings * np.log(left.power / power) - cost
        size = float(np.ptp(ramps @ found))
        spread = float(np.std(comparison.columns(now)[j].tau))
        if gain < SURE - np.log(LIMITS.fault) or size < LEAST * spread:
            continue

        def drifting(now: Reading, j: int = j) -> Reading:
            return replace(now, drifts=now.drifts | (np.arange(len(now.drifts)) == j))

        values = {"drift": size, "unit": "N" if comparison.robot.prismatic[j] else "Nm"}
        yield Fault("drift", (j,), "tau", drifting, values=values, open=-float(cost))
