"""Logs that were filtered before they were written, for `benchmarks.measuring_stick`.

Robots of `benchmarks.robotlike_study`, planar arms and UR5 in turn, each with three to eight hidden effects
and no unmodelled torque. Position and torque of every group pass the same filter at the recorded rate,
so the noise floor lies far below what a model leaves. DIR/cases are the sets, DIR/truth what is hidden in
them: the shares are those of the unfiltered record. What is there is not made again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from benchmarks.diagnosis_study.cases import generator
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import plan_of, write_case
from benchmarks.running import is_made, say
from flexviz.model.simulation import Plan, Run

Array = NDArray[np.float64]

COUNT = 12
ROBOTS = ("2r", "ur5")
EFFECTS = (3, 8)  # fewest and most that are hidden
HERTZ = (5.0, 20.0)  # half-power frequencies
HALF_POWER_WINDOW = 0.443  # length of a moving average [s] times its half-power frequency [Hz]


def butterworth(signal: Array, rate: float, hertz: float, order: int = 2) -> Array:
    """Zero-phase Butterworth, as in a script that prepares a data set.

    Args:
        signal: shape (N, n).
        rate: of the samples [Hz].
        hertz: where half of the power is left; run forwards and backwards, a quarter.
    """
    return sosfiltfilt(butter(order, hertz, fs=rate, output="sos"), signal, axis=0)


def low_pass(signal: Array, rate: float, hertz: float) -> Array:
    """Causal low-pass of second order, as in a drive; it starts at the first sample."""
    sections = butter(2, hertz, fs=rate, output="sos")
    return sosfilt(sections, signal, axis=0, zi=sosfilt_zi(sections)[:, :, None] * signal[0])[0]


def moving_average(signal: Array, rate: float, hertz: float) -> Array:
    """Mean of the latest samples, as in a logger; before the first sample the signal stands still."""
    length = max(round(HALF_POWER_WINDOW * rate / hertz), 2)
    before = np.repeat(signal[:1], length, axis=0)
    total = np.cumsum(np.concatenate((before, signal)) - signal[0], axis=0)
    return signal[0] + (total[length:] - total[:-length]) / length


FILTERS: dict[str, Callable[[Array, float, float], Array]] = {
    "butterworth": butterworth,
    "low-pass": low_pass,
    "average": moving_average,
}
"""Name in a set's name → the filter."""


@dataclass(frozen=True)
class Filtered:
    """One set.

    Attributes:
        case: whose robot it is.
        filter: name of the filter.
        hertz: its half-power frequency.
        plan: with everything hidden in it.
    """

    case: RobotCase
    filter: str
    hertz: float
    plan: Plan

    def logged(self, run: Run) -> Run:
        """What is left of a run's signals."""
        rate = 1.0 / float(run.time[1] - run.time[0])  # [Hz]
        smooth = FILTERS[self.filter]
        return replace(run, theta=smooth(run.theta, rate, self.hertz), tau=smooth(run.tau, rate, self.hertz))


def planned(seed: int, count: int = COUNT) -> Iterator[Filtered]:
    """The sets of a seed; every filter meets every robot."""
    found = dict.fromkeys(ROBOTS, -1)
    for k in range(count):
        robot, name = ROBOTS[k % len(ROBOTS)], list(FILTERS)[k // len(ROBOTS) % len(FILTERS)]
        hertz = float(np.exp(generator(seed, f"filter {k}").uniform(*np.log(HERTZ))))
        while True:
            found[robot] += 1
            case = RobotCase(f"filtered{seed}-{robot}-{found[robot]:03d}-{name}-{hertz:.0f}hz", robot, seed)
            plan, laws = plan_of(case)
            if not laws and EFFECTS[0] <= hidden(plan) <= EFFECTS[1]:
                break
        yield Filtered(case, name, hertz, plan)


def hidden(plan: Plan) -> int:
    """How many effects a plan hides; a filtered current counts as a delay."""
    return len(plan.model.effects) + (plan.sensors.torque_filter > 0)


def make(work: Path, seed: int, count: int = COUNT) -> None:
    """Simulate and write the sets that are not there."""
    for k, one in enumerate(planned(seed, count), 1):
        if not is_made(work, one.case.name):
            write_case(work, one.case, one.plan, logged=one.logged)
        say(f"{k}/{count} {one.case.name}: {hidden(one.plan)} effects")
