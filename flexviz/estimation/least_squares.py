"""Damped Gauss–Newton for weighted least squares with a prior and bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Equation, Evaluation
from flexviz.estimation.prior import Prior

Array = NDArray[np.float64]

MAX_HALVINGS = 12


class Stopped(Exception):
    """Raised inside the solver when the user stops it; the solver returns what it has."""


@dataclass(frozen=True)
class Bounds:
    """Limits of each parameter, shape (P,) each."""

    lower: Array
    upper: Array

    def clip(self, x: Array) -> Array:
        return np.clip(x, self.lower, self.upper)


@dataclass(frozen=True)
class Solution:
    """Where the solver ended.

    Attributes:
        x: shape (P,).
        evaluation: the equation at x.
        weights: shape (N, n), 1/σ of each sample and joint [1/Nm].
        converged: the last step was negligible.
        at_bound: shape (P,), parameters held at a bound.
        cost: ½ Σ (r/σ)² + prior.
    """

    x: Array
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
    mask: NDArray[np.bool_] | None = None,
    reweightings: int = 3,
    max_iterations: int = 60,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
    tolerance: float = 1e-2,
) -> Solution:
    """Minimise ½ Σ (r/σ)² + prior over x.

    σ is each joint's own residual standard deviation, estimated anew after each convergence.

    Args:
        equation: the residual.
        prior: of the parameters.
        bounds: of the parameters.
        x: start, feasible.
        mask: shape (N, n), samples to use; all where None.
        reweightings: how often σ is estimated; more often where columns follow the stiffness.
        max_iterations: over all reweightings.
        report: called with x, cost and step length; may raise `Stopped`.
        tolerance: a step shorter than this (in standard deviations) ends a round.

    Returns:
        the solution; `converged` is False when the iterations ran out or the user stopped it.
    """
    used = np.ones(equation.signals.tau.shape[1:], bool) if mask is None else mask
    equation.prepare(x)
    now = equation.evaluate(x)
    at_bound = np.zeros(len(x), bool)
    iterations = 0
    weights = _weights(now.residual, used, equation)
    cost = _cost(now, weights, prior, x)
    converged = False
    try:
        report(x, cost, np.inf)
        for _ in range(reweightings + (5 if equation.has_state else 0)):
            converged = False
            while iterations < max_iterations:
                iterations += 1
                gradient, hessian = normal_equations(now, weights, prior, x)
                step, at_bound = bounded_step(gradient, hessian, x, bounds)
                length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
                if length < tolerance:
                    converged = True
                    break
                accepted = _line_search(equation, weights, prior, bounds, x, step, cost)
                if accepted is None:
                    converged = length < 1.0  # nothing better within a tenth of a standard deviation or so
                    break
                x, now, cost = accepted
                report(x, cost, length)
            changed = equation.prepare(x)
            if changed:
                now = equation.evaluate(x)
            new = _weights(now.residual, used, equation)
            settled = converged and not changed and np.allclose(new[new > 0], weights[new > 0], rtol=0.02)
            weights = new
            cost = _cost(now, weights, prior, x)
            if settled:
                break
    except Stopped:
        converged = False
    return Solution(x, now, weights, converged, at_bound, cost)


def normal_equations(now: Evaluation, weights: Array, prior: Prior, x: Array) -> tuple[Array, Array]:
    """Gradient (P,) and Gauss–Newton Hessian (P, P) of the cost."""
    size = now.jacobian.shape[2]
    scaled = (now.jacobian * weights[:, :, None]).reshape(-1, size)
    residual = (now.residual * weights).ravel()
    gradient, hessian = prior.gradient_and_hessian(x)
    return gradient + scaled.T @ residual, hessian + scaled.T @ scaled


def bounded_step(
    gradient: Array, hessian: Array, x: Array, bounds: Bounds
) -> tuple[Array, NDArray[np.bool_]]:
    """The Gauss–Newton step with parameters that would cross a bound put onto it; and which those are."""
    fixed = np.zeros(len(x), bool)
    step = np.zeros(len(x))
    for _ in range(len(x)):
        free = ~fixed
        right = -gradient[free] - hessian[np.ix_(free, fixed)] @ step[fixed]
        step[free] = _solve(hessian[np.ix_(free, free)], right)
        crossing = free & ((x + step < bounds.lower) | (x + step > bounds.upper))
        if not crossing.any():
            break
        step[crossing] = bounds.clip(x + step)[crossing] - x[crossing]
        fixed |= crossing
    return step, fixed


def _solve(matrix: Array, right: Array) -> Array:
    """Solve with the diagonal scaled to one: the parameters' units differ by many orders."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * scale[:, None] * scale
    try:
        return scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:
        return scale * np.linalg.lstsq(scaled, scale * right, rcond=1e-12)[0]


def _weights(residual: Array, used: NDArray[np.bool_], equation: Equation) -> Array:
    floor = 1e-9 * np.sqrt(np.mean(equation.signals.tau[0] ** 2, axis=0)) + 1e-12
    count = np.maximum(used.sum(axis=0), 1)
    sigma = np.sqrt((residual**2 * used).sum(axis=0) / count)
    return used / np.maximum(sigma, floor)


def _cost(now: Evaluation, weights: Array, prior: Prior, x: Array) -> float:
    return 0.5 * float(((now.residual * weights) ** 2).sum()) + prior.value(x)


def _line_search(
    equation: Equation, weights: Array, prior: Prior, bounds: Bounds, x: Array, step: Array, cost: float
) -> tuple[Array, Evaluation, float] | None:
    """The first of x + step, x + step/2, … that lowers the cost; None when none does."""
    compliance = equation.layout.compliance
    length = 1.0
    for _ in range(MAX_HALVINGS):
        trial = bounds.clip(x + length * step)
        # within one step a stiffness may grow at most tenfold: the residual is nearly linear in c,
        # not exactly
        trial[compliance] = np.maximum(trial[compliance], 0.1 * x[compliance])
        if prior.feasible(trial):
            now = equation.evaluate(trial)
            trial_cost = _cost(now, weights, prior, trial)
            if np.isfinite(trial_cost) and trial_cost < cost:
                return trial, now, trial_cost
        length *= 0.5
    return None
