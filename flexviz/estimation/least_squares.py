"""Damped Gauss–Newton for weighted least squares with a prior and bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Equation, Evaluation, OperatingPoint
from flexviz.estimation.linear_algebra import Bounds, bounded_step, scaled_solve
from flexviz.estimation.prior import Prior

Array = NDArray[np.float64]

MAX_HALVINGS = 12
SAMPLES_TOGETHER = 4000  # weighted at a time
ACCELERATION_DEPTH = 3  # past steps that an extrapolated step combines
SHRINKING = 0.5  # times the last step, below which a step needs no extrapolation


class Stopped(Exception):
    """Raised inside the solver when the user stops it; the solver returns its present state."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Final state of the solver.

    Attributes:
        x: shape (P,).
        point: operating point of the effects.
        evaluation: the equation at x.
        weights: shape (N, n), 1/σ of each sample and joint [1/Nm].
        converged: the last step was negligible.
        at_bound: shape (P,), parameters held at a bound.
        cost: ½ Σ (r/σ)² + prior.
    """

    x: Array
    point: OperatingPoint
    evaluation: Evaluation
    weights: Array
    converged: bool
    at_bound: NDArray[np.bool_]
    cost: float


def gauss_newton(
    equation: Equation,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    after: OperatingPoint | None = None,
    mask: NDArray[np.bool_] | None = None,
    reweightings: int = 3,
    max_iterations: int = 60,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
    tolerance: float = 1e-2,
) -> Solution:
    """Minimise ½ Σ (r/σ)² + prior over x.

    σ is the standard deviation of each joint's residual, re-estimated after each convergence.

    Args:
        equation: the residual.
        prior: prior of the parameters.
        bounds: bounds of the parameters.
        x: feasible start, shape (P,).
        after: operating point of an earlier fit of the same equation.
        mask: shape (N, n), samples to use; default: all.
        reweightings: number of estimates of σ; five more for effects that depend on identified quantities.
        max_iterations: over all reweightings.
        report: called with x, cost and step length; may raise `Stopped`.
        tolerance: step length that ends a round [standard deviations].

    Returns:
        the solution; `converged` is False if the iterations ran out or the user stopped the fit.
    """
    descent = _Descent(equation, prior, bounds, x, after, mask, report, tolerance)
    left = max_iterations
    converged = False
    try:
        report(x, descent.cost, np.inf)
        for _ in range(reweightings + (5 if equation.has_state else 0)):
            converged = False
            left, converged = descent.run(left)
            if descent.reweight() and converged:
                break
    except Stopped:
        converged = False
    now = descent
    return Solution(now.x, now.point, now.evaluation, now.weights, converged, now.at_bound, now.cost)


class _Descent:
    """One fit: steps at fixed weights, then new weights."""

    def __init__(
        self,
        equation: Equation,
        prior: Prior,
        bounds: Bounds,
        x: Array,
        after: OperatingPoint | None,
        mask: NDArray[np.bool_] | None,
        report: Callable[[Array, float, float], None],
        tolerance: float,
    ) -> None:
        self.equation, self.prior, self.bounds, self.x = equation, prior, bounds, x
        self.used = np.ones(equation.signals.tau.shape[1:], bool) if mask is None else mask
        self.report, self.tolerance = report, tolerance
        self.point = equation.at(x, after)
        self.evaluation = self.point.evaluate(x)
        self.at_bound = np.zeros(len(x), bool)
        self.weights = _weights(self.evaluation.residual, self.used, equation)
        self.cost = weighted_cost(self.evaluation, self.weights, prior, x)

    def run(self, iterations: int) -> tuple[int, bool]:
        """Take steps at fixed weights; returns the iterations left and whether the fit has converged."""
        past: list[tuple[Array, Array]] = []  # of each iteration: x and the Gauss–Newton step there
        while iterations > 0:
            iterations -= 1
            gradient, hessian = normal_equations(self.evaluation, self.weights, self.prior, self.x)
            step, self.at_bound = bounded_step(gradient, hessian, self.x, self.bounds)
            length = _length(step, hessian)
            if length < self.tolerance:
                return iterations, True
            past = [*past[-ACCELERATION_DEPTH:], (self.x, step)]
            accepted = self._accelerated(past, hessian) or self._search(step, MAX_HALVINGS)
            if accepted is None:
                # no improvement along the step: converged if it is shorter than a standard deviation
                return iterations, length < 1.0
            self.x, self.evaluation, self.cost = accepted
            self.report(self.x, self.cost, length)
        return iterations, False

    def _accelerated(
        self, past: list[tuple[Array, Array]], hessian: Array
    ) -> tuple[Array, Evaluation, float] | None:
        """A step extrapolated from the last ones, if they hardly shrink and it lowers the cost.

        Gauss–Newton zigzags or creeps where the residual is large and curved. Anderson acceleration takes the
        step to where the linear combination of the last steps is smallest (Walker, Ni: Anderson acceleration
        for fixed-point iterations, SIAM J. Numer. Anal. 49(4), 2011).
        """
        if len(past) < 2 or _length(past[-1][1], hessian) < SHRINKING * _length(past[-2][1], hessian):
            return None
        places, steps = (np.stack(part, axis=1) for part in zip(*past, strict=True))
        moves: Array = places[:, 1:] - places[:, :-1]
        changes: Array = steps[:, 1:] - steps[:, :-1]
        step = past[-1][1]
        share = scaled_solve(changes.T @ hessian @ changes, changes.T @ hessian @ step)
        return self._search(step - (moves + changes) @ share, 1)

    def _search(self, step: Array, halvings: int) -> tuple[Array, Evaluation, float] | None:
        place = self.point, self.weights, self.prior, self.bounds
        return line_search(*place, self.x, step, self.cost, halvings)

    def reweight(self) -> bool:
        """Re-estimate the weights; returns whether weights and operating point are unchanged."""
        point = self.equation.at(self.x, self.point)
        changed = point is not self.point
        if changed:
            self.point, self.evaluation = point, point.evaluate(self.x)
        old, self.weights = self.weights, _weights(self.evaluation.residual, self.used, self.equation)
        self.cost = weighted_cost(self.evaluation, self.weights, self.prior, self.x)
        used = self.weights > 0
        return not changed and np.allclose(self.weights[used], old[used], rtol=0.02)


def _length(step: Array, hessian: Array) -> float:
    """In standard deviations of the parameters."""
    return float(np.sqrt(max(step @ hessian @ step, 0.0)))


def normal_equations(now: Evaluation, weights: Array, prior: Prior, x: Array) -> tuple[Array, Array]:
    """Gradient (P,) and Gauss–Newton Hessian (P, P) of the cost."""
    gradient, hessian = prior.gradient_and_hessian(x)
    for first in range(0, len(weights), SAMPLES_TOGETHER):
        rows = slice(first, first + SAMPLES_TOGETHER)
        scaled = (now.jacobian[rows] * weights[rows, :, None]).reshape(-1, len(x))
        gradient = gradient + scaled.T @ (now.residual[rows] * weights[rows]).ravel()
        hessian = hessian + scaled.T @ scaled
    return gradient, hessian


def _weights(residual: Array, used: NDArray[np.bool_], equation: Equation) -> Array:
    floor = 1e-9 * np.sqrt(np.mean(equation.signals.tau[0] ** 2, axis=0)) + 1e-12
    count = np.maximum(used.sum(axis=0), 1)
    sigma = np.sqrt((residual**2 * used).sum(axis=0) / count)
    return used / np.maximum(sigma, floor)


def weighted_cost(now: Evaluation, weights: Array, prior: Prior, x: Array) -> float:
    return 0.5 * float(((now.residual * weights) ** 2).sum()) + prior.value(x)


def line_search(
    point: OperatingPoint,
    weights: Array,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    step: Array,
    cost: float,
    halvings: int = MAX_HALVINGS,
) -> tuple[Array, Evaluation, float] | None:
    """The first of x + step, x + step/2, … that lowers the cost; None if none does."""
    compliance = point.layout.compliance
    length = 1.0
    for _ in range(halvings):
        trial = bounds.clip(x + length * step)
        # a stiffness may grow at most tenfold per step: the residual is only nearly linear in c
        trial[compliance] = np.maximum(trial[compliance], 0.1 * x[compliance])
        if prior.feasible(trial):
            now = point.evaluate(trial)
            trial_cost = weighted_cost(now, weights, prior, trial)
            if np.isfinite(trial_cost) and trial_cost < cost:
                return trial, now, trial_cost
        length *= 0.5
    return None
