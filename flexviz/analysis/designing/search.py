"""Search for the groups: differential evolution on one group at a time, the others held.

Information adds up over groups, so that only the group that changes is evaluated. The search starts from a
random design that keeps the limits and holds the best design at any time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import differential_evolution

from flexviz.analysis.designing.criterion import DesignCriterion
from flexviz.analysis.designing.motion import MotionSpace, shrunk
from flexviz.analysis.designing.subject import Planned, Subject
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.data.measurements import Group, MeasurementSet

Gram = Callable[[MeasurementSet, list[Group]], Array]

POPULATION = 24
FORBIDDEN = 1e3  # criterion of a motion beyond its limits, plus its excess
SHRINK, MOST_SHRINKS = 0.85, 10  # of a random motion until it keeps the limits


@dataclass(frozen=True, eq=False)
class Trial:
    """A group that was evaluated: its point in the unit cube, motion, information, use of the limits."""

    u: Array
    planned: Planned
    gram: Array
    excess: float


@dataclass
class GroupSearch:
    """The search; `groups` is the best design so far."""

    subject: Subject  # the robot
    space: MotionSpace  # motions to choose from
    gram: Gram  # information of groups
    criterion: DesignCriterion  # to be minimised
    known: Array  # information of groups that are recorded already, (Q, Q)
    step: float  # of the predicted motions [s]
    seed: int  # of the random numbers
    # called with the evaluations done and the best value; may raise to stop
    tell: Callable[[int, float], None]
    groups: list[Trial] = field(default_factory=list)
    evaluations: int = 0
    value: float = np.inf

    def start(self) -> float:
        """A random design within the limits; returns its criterion."""
        rng = np.random.default_rng(self.seed)
        count, payloads = self.space.settings.groups, len(self.space.payloads)
        for k in range(count):
            u = rng.random(self.space.size)
            u[0] = (k % payloads + 0.5) / payloads
            self.groups.append(self._feasible(u, f"d{k + 1}", rng))
        self.value = self.criterion.value(self.known + sum(t.gram for t in self.groups))
        return self.value

    def improve(self, k: int, evaluations: int) -> None:
        """Search a better group k."""
        rng = np.random.default_rng([self.seed, k, self.evaluations])
        others = self.known + sum(t.gram for i, t in enumerate(self.groups) if i != k)
        name = self.groups[k].planned.name

        def cost(u: Array) -> float:
            trial = self._evaluated(u, self.space.planned(u, name))
            if trial.excess > 0:
                return FORBIDDEN + trial.excess
            value = self.criterion.value(others + trial.gram)
            if value < self.value:
                self.value, self.groups[k] = value, trial
            self.tell(self.evaluations, self.value)
            return value

        first = rng.random((POPULATION, self.space.size))
        first[0] = self.groups[k].u
        near = POPULATION // 3
        first[1:near] = np.clip(first[0] + 0.1 * rng.standard_normal((near - 1, self.space.size)), 0.0, 1.0)
        differential_evolution(
            cost,
            [(0.0, 1.0)] * self.space.size,
            init=first,  # pyright: ignore[reportArgumentType]
            maxiter=max(1, evaluations // POPULATION - 1),
            mutation=(0.3, 0.9),
            recombination=0.8,
            tol=0.0,
            polish=False,
            rng=rng,
        )

    def _evaluated(self, u: Array, planned: Planned) -> Trial:
        self.evaluations += 1
        measurements = self.subject.predicted([planned], self.step)
        (group,) = measurements.groups
        excess = self.space.used(group)[0].share - 1.0
        gram = np.zeros_like(self.known) if excess > 0 else self.gram(measurements, [group])
        return Trial(u, planned, gram, excess)

    def _feasible(self, u: Array, name: str, rng: np.random.Generator) -> Trial:
        """A motion within the limits, near u or at random; its amplitude is reduced where necessary."""
        excess = np.inf
        for _ in range(MOST_SHRINKS):
            planned = self.space.planned(u, name)
            for share in (1.0, SHRINK**2, SHRINK**5, SHRINK**10):
                trial = self._evaluated(u, shrunk(planned, share))
                self.tell(self.evaluations, self.value)
                if trial.excess <= 0:
                    return trial
                excess = min(excess, trial.excess)
            u = np.concatenate((u[:1], rng.random(self.space.size - 1)))
        (group,) = self.subject.predicted([trial.planned], self.step).groups
        used = self.space.used(group)
        raise InputError(
            f"no motion within the limits was found: {used[0].limit} is exceeded by {100 * excess:.0f} %; "
            "expected wider limits or lighter payloads"
        )
