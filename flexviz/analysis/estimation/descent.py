"""The one loop of all fits: bounded Gauss–Newton steps, shortened where they lead uphill.

At a place x a problem gives the gradient g and the Hessian H ≈ Zᵀ W Z + prior of its objective. The step
solves H δx = −g within the bounds; its length √(δxᵀ H δx) is in standard deviations of the parameters, and a
descent ends where that is negligible. Weights are the problem's: fixed, or renewed at every place.

    problem = Weighted(…)                        # at, lower, normal_equations
    descent = Descent(problem, Reach(bounds), place, damped=True)
    descent.run(iterations=25)
    descent.place, descent.converged
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np

from flexviz.analysis.estimation.linear_algebra import Bounds, bounded_step, scaled_solve
from flexviz.analysis.estimation.thresholds import ESTIMATION
from flexviz.base.arrays import Array

HALVINGS = 12  # tried to find a lower place
SHORTEST = 30  # halvings to the first feasible point of a step
ACCELERATION_DEPTH = 3  # past steps that an extrapolated step combines
SHRINKING = 0.5  # times the last step, below which a step needs no extrapolation


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations H δx = −g of one Gauss–Newton step.

    Attributes:
        gradient: shape (P,), g = Zᵀ W r (less its mean due to noise) + gradient of the prior.
        information: shape (P, P), Zᵀ W Z.
        prior_hessian: shape (P, P).
    """

    gradient: Array
    information: Array
    prior_hessian: Array

    @property
    def hessian(self) -> Array:
        """H, shape (P, P)."""
        return self.information + self.prior_hessian


class Place(Protocol):
    """A point of a descent, with whatever its problem needs there."""

    @property
    def x(self) -> Array: ...

    @property
    def objective(self) -> float: ...


P = TypeVar("P", bound=Place)


class Problem(Protocol[P]):
    """What a descent minimises."""

    def at(self, x: Array, before: P) -> P:
        """The place at x, shape (P,), after another one; may renew the weights."""
        ...

    def lower(self, x: Array, before: P) -> P | None:
        """The place at x if it has the lower objective, else None; asked if damped."""
        ...

    def normal_equations(self, place: P) -> NormalEquations:
        """Gradient and Hessian of the objective."""
        ...


@dataclass(frozen=True)
class Reach:
    """How far one step may go.

    Attributes:
        bounds: of the parameters.
        feasible: whether x is possible: consistent bodies and admissible effects (`Prior.feasible`).
        compliance: parameters that change at most by the `factors` in one step: the residual is only nearly
            linear in them.
        factors: least and largest.
    """

    bounds: Bounds
    feasible: Callable[[Array], bool] = lambda x: True
    compliance: slice = field(default_factory=lambda: slice(0))
    factors: tuple[float, float] = (0.2, 5.0)

    def along(self, x: Array, step: Array, halvings: int) -> Iterator[Array]:
        """The possible ones of x + step, x + step/2, …"""
        least, largest = (factor * x[self.compliance] for factor in self.factors)
        for k in range(halvings):
            trial = self.bounds.clip(x + 0.5**k * step)
            trial[self.compliance] = np.clip(trial[self.compliance], least, largest)
            if self.feasible(trial):
                yield trial


class Descent(Generic[P]):
    """Gauss–Newton from a place on.

    Args:
        problem: what is minimised.
        reach: how far a step may go.
        place: the start.
        negligible: length of a step that ends the descent [standard deviations].
        settled: change of the objective, twice a negative log likelihood, that ends it: one that a step made,
            or that it promises at most.
        damped: halve a step until it leads lower, or else end the descent; otherwise it is taken whole.
        accelerated: extrapolate slow steps (`_extrapolated`).
        watch: called at every place; may raise to stop, and ends the descent by True.

    Attributes:
        place: the last one.
        best: the one of least objective.
        normal: normal equations at the last place.
        at_bound: shape (P,), parameters that the step from there holds at a bound.
        came, length: of the step that led to the last place, infinite at first, and of the one from there.
        steps: taken in this run.
        gained: decrease of the objective by the last step, infinite at first.
        converged: the step from there is negligible or the objective settled.
        ended: `watch` has ended the descent.
        stuck: no place along that step is possible and, if damped, lower.
    """

    place: P
    best: P
    normal: NormalEquations

    def __init__(
        self,
        problem: Problem[P],
        reach: Reach,
        place: P,
        *,
        negligible: float = ESTIMATION.negligible_step,
        settled: float = 0.0,
        damped: bool = False,
        accelerated: bool = False,
        watch: Callable[[Descent[P]], bool | None] = lambda descent: None,
    ) -> None:
        self.problem, self.reach, self.place, self.best = problem, reach, place, place
        self.negligible, self.settled, self.damped = negligible, settled, damped
        self.accelerated, self.watch = accelerated, watch
        self.at_bound = np.zeros(len(place.x), bool)

    def run(self, iterations: int) -> None:
        """Descend from the last place, by so many steps at most."""
        self.best, self.steps, self.stuck = self.place, 0, False
        self.came = self.gained = np.inf
        past: list[tuple[Array, Array]] = []  # of each step: where it began and where it led
        while True:
            self.normal = self.problem.normal_equations(self.place)
            x, hessian = self.place.x, self.normal.hessian
            step, self.at_bound = bounded_step(self.normal.gradient, hessian, x, self.reach.bounds)
            self.length = _length(step, hessian)
            promised = self.length**2
            self.converged = self.length < self.negligible or min(abs(self.gained), promised) < self.settled
            self.ended = bool(self.watch(self))
            if self.converged or self.ended or self.steps == iterations:
                break
            past = [*past[-ACCELERATION_DEPTH:], (x, step)]
            halvings = HALVINGS if self.damped else 0
            if halvings and self.settled:  # a part f of a step promises 2 f of the whole, at most
                halvings = min(halvings, 1 + int(np.log2(2 * promised / self.settled)))
            there = self._extrapolated(past, hessian) or self._along(step, halvings)
            if there is None:
                self.stuck = True
                break
            self.came, self.gained = self.length, self.place.objective - there.objective
            self.place, self.steps = there, self.steps + 1
            if there.objective < self.best.objective:
                self.best = there

    def _along(self, step: Array, halvings: int) -> P | None:
        """The first lower place along a step; without halvings the first possible one."""
        before = self.place
        if not halvings:
            possible = next(self.reach.along(before.x, step, SHORTEST), None)
            return None if possible is None else self.problem.at(possible, before)
        tried = (self.problem.lower(x, before) for x in self.reach.along(before.x, step, halvings))
        return next((there for there in tried if there is not None), None)

    def _extrapolated(self, past: list[tuple[Array, Array]], hessian: Array) -> P | None:
        """A step extrapolated from the last ones, if they hardly shrink and it leads lower.

        Gauss–Newton zigzags or creeps where the residual is large and curved. Anderson acceleration takes the
        step to where the linear combination of the last steps is smallest (Walker, Ni: Anderson acceleration
        for fixed-point iterations, SIAM J. Numer. Anal. 49(4), 2011).
        """
        if not self.accelerated or len(past) < 2:
            return None
        if _length(past[-1][1], hessian) < SHRINKING * _length(past[-2][1], hessian):
            return None
        places, steps = (np.stack(part, axis=1) for part in zip(*past, strict=True))
        moves: Array = places[:, 1:] - places[:, :-1]
        changes: Array = steps[:, 1:] - steps[:, :-1]
        step = past[-1][1]
        share = scaled_solve(changes.T @ hessian @ changes, changes.T @ hessian @ step)
        return self._along(step - (moves + changes) @ share, 1)


def _length(step: Array, hessian: Array) -> float:
    """In standard deviations of the parameters."""
    return float(np.sqrt(max(step @ hessian @ step, 0.0)))
