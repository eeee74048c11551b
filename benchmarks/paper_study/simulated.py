"""The paper's groups, simulated once and kept in memory; noise is added to the record afterwards.

The controller does not feel the noise, so one noise-free motion serves every noise seed. Like the files that
`flexviz simulate paper-b` writes, the record is float64.
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from benchmarks.design_study.sets import in_memory
from flexviz.data.measurements import MeasurementSet
from flexviz.model.simulation import Plan, Run, make_plan
from flexviz.robot.robot import PayloadBody

Array = NDArray[np.float64]

LETTERS = "abcdef"
STARTS = ("rest", "moving")


@dataclass(frozen=True, eq=False)
class Motion:
    """The true motion of one group: what happened, before any sensor.

    Attributes:
        run: the simulated motion, sampled every controller cycle.
        bodies: the payload.
    """

    run: Run
    bodies: tuple[PayloadBody, ...]


@dataclass(frozen=True, eq=False)
class Study:
    """One of the paper's groups from one start.

    Attributes:
        letter: "a" … "f".
        start: "rest" or "moving".
        plan: what was simulated, with the true parameters.
        clean: the measurement set without noise.
        motions: group name → its true motion.
    """

    letter: str
    start: str
    plan: Plan
    clean: MeasurementSet
    motions: dict[str, Motion]

    def noisy(self, seed: int) -> MeasurementSet:
        """The set as its sensors record it, with the noise of `seed`."""
        sensors = self.plan.sensors
        groups = []
        for index, group in enumerate(self.clean.groups):
            (segment,) = group.segments
            samples, n = segment.theta.shape
            theta, tau = sensors.noise(samples, n, np.random.default_rng([seed, index]))
            recorded = replace(segment, theta=segment.theta + theta, tau=segment.tau + tau)
            groups.append(replace(group, segments=(recorded,)))
        return replace(self.clean, groups=tuple(groups))

    @property
    def fitted(self) -> list[Motion]:
        """The true motions of the groups that are fitted."""
        return [self.motions[group.name] for group in self.clean.fit_groups]


_MOTIONS: dict[tuple[str, str], Motion] = {}  # (trajectory-payload pair, start); several groups share a pair


def _simulate(pair: str, start: str) -> Motion:
    for letter in LETTERS:
        plan = make_plan(f"paper-{letter}", start=start)
        for group in plan.groups:
            if group.name == pair:
                return Motion(plan.run(group), plan.payloads[group.payload])
    raise KeyError(pair)


def _motion(pair: str, start: str) -> Motion:
    if (pair, start) not in _MOTIONS:
        _MOTIONS[pair, start] = _simulate(pair, start)
    return _MOTIONS[pair, start]


def pool(processes: int) -> ProcessPoolExecutor:
    """Worker processes that share what this one has simulated so far."""
    return ProcessPoolExecutor(processes, mp_context=get_context("fork"))


def simulate_all(letters: Iterable[str], starts: Iterable[str], processes: int = 2) -> None:
    """Simulate what these groups need, several motions at a time."""
    plans = [make_plan(f"paper-{letter}") for letter in letters]
    pairs = {(group.name, start) for plan in plans for group in plan.groups for start in starts}
    missing = sorted(pairs - set(_MOTIONS))
    if processes > 1 and len(missing) > 1:
        with pool(processes) as workers:
            motions = workers.map(_simulate, *zip(*missing, strict=True))
            _MOTIONS.update(zip(missing, motions, strict=True))


@cache
def study(letter: str, start: str) -> Study:
    """Group `letter` from `start`: fit groups and one validation group."""
    plan = make_plan(f"paper-{letter}", start=start)
    motions = {group.name: _motion(group.name, start) for group in plan.groups}
    clean = replace(in_memory(plan, {name: motion.run for name, motion in motions.items()}), simulated=True)
    return Study(letter, start, plan, clean, motions)
