"""Weighted least squares in one band, with a prior and bounds, weighted by its own residual."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexviz.analysis.estimation.descent import Descent, NormalEquations, Reach
from flexviz.analysis.estimation.linear_algebra import Bounds
from flexviz.analysis.estimation.prior import Prior
from flexviz.base.arrays import Array, Bools
from flexviz.model.equation import Equation, Evaluation, OperatingPoint

STIFFER = 0.1  # times its compliance: a stiffness may grow at most tenfold in one step, and fall at will
SAMPLES_TOGETHER = 4000  # weighted at a time
STATE_REWEIGHTINGS = 5  # more, for effects that depend on identified quantities


class Stopped(Exception):
    """Raised inside the solver when the user stops it; the solver returns its present state."""


@dataclass(frozen=True, eq=False)
class Solution:
    """State of the solver.

    Attributes:
        x: shape (P,).
        point: operating point of the effects.
        evaluation: the equation at x.
        weights: shape (N, n), 1/σ of each sample and joint [1/Nm]; 0 where a torque is not known.
        objective: ½ Σ (r/σ)² + prior.
        at_bound: shape (P,), parameters held at a bound.
        converged: the last step was negligible.
    """

    x: Array
    point: OperatingPoint
    evaluation: Evaluation
    weights: Array
    objective: float
    at_bound: Bools
    converged: bool

    @property
    def whitened(self) -> tuple[Array, Array]:
        """Weighted residual (N, n) and Jacobian (N, n, P)."""
        now, weights = self.evaluation, self.weights
        return now.residual * weights, now.jacobian * weights[:, :, None]


def gauss_newton(
    equation: Equation,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    after: OperatingPoint | None = None,
    reweightings: int = 3,
    max_iterations: int = 60,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
    watch: Callable[[], None] = lambda: None,
) -> Solution:
    """Minimise ½ Σ (r/σ)² + prior over x by Gauss–Newton with the exact Jacobian.

    Each step solves (Jᵀ J/σ² + H) δ = −(Jᵀ r/σ² + g), with gradient g and Hessian H of the prior, and is
    halved until the cost falls. σ is the standard deviation of each joint's residual, re-estimated after
    each convergence, so that every joint is weighted by its own error.

    Args:
        equation: the residual.
        prior: prior of the parameters.
        bounds: bounds of the parameters.
        x: feasible start, shape (P,).
        after: operating point of an earlier fit of the same equation.
        reweightings: number of estimates of σ; `STATE_REWEIGHTINGS` more for effects with a state.
        max_iterations: over all reweightings.
        report: called with x, cost and step length; may raise `Stopped`.
        watch: called before every evaluation of the equation, of which a step may need several; may raise
            `Stopped`.

    Returns:
        the solution; `converged` is False if the iterations ran out or the user stopped the fit.
    """

    def tell(descent: Descent[Solution]) -> None:
        if np.isfinite(descent.came):
            report(descent.place.x, descent.place.objective, descent.came)

    problem = PlainProblem(equation, prior, watch)
    start = problem.start(x, equation.at(x, after))
    reach = Reach(bounds, prior.feasible, equation.layout.compliance, (STIFFER, np.inf))
    descent = Descent(problem, reach, start, damped=True, accelerated=True, watch=tell)
    left, converged = max_iterations, False
    try:
        report(x, start.objective, np.inf)
        for _ in range(reweightings + STATE_REWEIGHTINGS * equation.has_state):
            converged = False
            if left > 0:
                descent.run(left)
                left -= descent.steps + 1
                # without a lower place along a step, it has converged if that is within a standard deviation
                converged = descent.converged or (descent.stuck and descent.length < 1.0)
            descent.place, settled = problem.reweighted(descent.place)
            if settled and converged:
                break
    except Stopped:
        converged = False
    return replace(descent.place, at_bound=descent.at_bound, converged=converged)


class PlainProblem:
    """½ Σ (r/σ)² + prior at fixed weights 1/σ, a `Problem` of `Descent`."""

    def __init__(self, equation: Equation, prior: Prior, watch: Callable[[], None]) -> None:
        self.equation, self.prior, self._watch = equation, prior, watch

    def start(self, x: Array, point: OperatingPoint) -> Solution:
        """The state at x, shape (P,), weighted by its own residual."""
        return self._weighted(
            Solution(x, point, point.evaluate(x), np.zeros(0), 0.0, np.zeros(len(x), bool), False)
        )

    def at(self, x: Array, before: Solution) -> Solution:
        """The state at x, shape (P,), with the weights of another."""
        self._watch()
        now = before.point.evaluate(x)
        return replace(
            before, x=x, evaluation=now, objective=weighted_cost(now, before.weights, self.prior, x)
        )

    def lower(self, x: Array, before: Solution) -> Solution | None:
        """The same if its cost is lower."""
        there = self.at(x, before)
        return there if there.objective < before.objective else None

    def normal_equations(self, place: Solution) -> NormalEquations:
        """Of the cost."""
        return normal_equations(place, self.prior)

    def reweighted(self, now: Solution) -> tuple[Solution, bool]:
        """The state with new weights, and whether they and the operating point are as before."""
        point = self.equation.at(now.x, now.point)
        changed = point is not now.point
        new = self._weighted(replace(now, point=point, evaluation=point.evaluate(now.x)) if changed else now)
        return new, not changed and np.allclose(new.weights, now.weights, rtol=0.02)

    def _weighted(self, now: Solution) -> Solution:
        signals = self.equation.signals
        floor = 1e-9 * np.sqrt(np.mean(signals.tau[0] ** 2, axis=0)) + 1e-12
        sigma = np.sqrt(signals.mean_square(now.evaluation.residual))
        weights = signals.known * (self.equation.layout.fitted / np.maximum(sigma, floor))
        return replace(
            now, weights=weights, objective=weighted_cost(now.evaluation, weights, self.prior, now.x)
        )


def normal_equations(place: Solution, prior: Prior) -> NormalEquations:
    """Normal equations of the cost."""
    now, weights, size = place.evaluation, place.weights, len(place.x)
    gradient, prior_hessian = prior.gradient_and_hessian(place.x)
    information = np.zeros((size, size))
    for first in range(0, len(weights), SAMPLES_TOGETHER):
        rows = slice(first, first + SAMPLES_TOGETHER)
        scaled = (now.jacobian[rows] * weights[rows, :, None]).reshape(-1, size)
        gradient = gradient + scaled.T @ (now.residual[rows] * weights[rows]).ravel()
        information = information + scaled.T @ scaled
    return NormalEquations(gradient, information, prior_hessian)


def weighted_cost(now: Evaluation, weights: Array, prior: Prior, x: Array) -> float:
    """½ Σ (r/σ)² + prior."""
    return 0.5 * float(((now.residual * weights) ** 2).sum()) + prior.value(x)
