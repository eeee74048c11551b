"""Instrumental-variables estimation, without the bias due to filtering and noise.

Two bands: the residual r comes from a wide filter that is exactly flat at the frequencies of the motion, so
that products of filtered signals are correct; it is noisy, but its noise covariance is known (`whitening`).
The Jacobian comes from a narrow filter with little noise and serves as instrument Z. The equation solved is
Zᵀ W r = b, with W the inverse covariance (generalised least squares without errors-in-variables bias) and b
the mean contribution of noise that Z and r share (`instrument_bias`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexviz.analysis.estimation.descent import Descent, NormalEquations, Reach
from flexviz.analysis.estimation.linear_algebra import Bounds
from flexviz.analysis.estimation.prior import Prior
from flexviz.analysis.estimation.thresholds import ESTIMATION
from flexviz.analysis.estimation.two_band import TwoBandData
from flexviz.analysis.estimation.weighted_point import Point, Whitening
from flexviz.base.arrays import Array

IMPROVED = 0.997  # factor on the objective, below which a step has improved it
MAX_ITERATIONS = 12  # of a refinement; twice as many while a model error is adapted
PATIENCE = 2  # steps without a better objective that end a fit far above the noise


class Solved(Descent[Point]):
    """A descent on Zᵀ W r = b and the prior."""

    @property
    def end(self) -> Point:
        """The last point if converged, else the best one."""
        return self.place if self.converged else self.best

    @property
    def consistent(self) -> bool:
        """Whether noise explains what is left at the last point."""
        return float(self.place.chi.mean()) <= ESTIMATION.consistent


def solve(
    whitening: Whitening,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    iterations: int,
    damped: bool = False,
    impatient: bool = False,
    settled: float = 0.0,
    check: Callable[[], None] = lambda: None,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
) -> Solved:
    """Gauss–Newton on Zᵀ W r = b and the prior.

    Args:
        whitening: computes the weighted points.
        prior: prior of the parameters.
        bounds: bounds of the parameters.
        x: start, shape (P,).
        iterations: maximum number of steps.
        damped: halve steps that raise the objective, and end if that does not help. Off by default: Zᵀ W r is
            not exactly the gradient of the objective, so that steps towards the solution may lead slightly
            uphill.
        impatient: end a fit far above the noise that does not find a better objective. There Zᵀ W r = b and
            the minimum of the objective differ, and steps of many standard deviations say nothing.
        settled: change of the objective by a step that ends it.
        check: called before each point; may raise to stop.
        report: called with x, cost and step length of each step; may raise to stop.
    """
    problem = _Instrumental(whitening, prior, check)
    idle, lowest = 0, np.inf

    def watch(descent: Descent[Point]) -> bool:
        nonlocal idle, lowest
        point, best = descent.place, descent.best.objective
        report(point.x, 0.5 * float((point.r**2).sum()), descent.length)
        idle, lowest = 0 if best < IMPROVED * lowest else idle + 1, best
        return impatient and idle >= PATIENCE and float(point.chi.mean()) > ESTIMATION.far_above_noise

    reach = Reach(bounds, prior.feasible, prior.layout.compliance)
    place = problem.at(bounds.clip(x))
    solved = Solved(problem, reach, place, damped=damped, settled=settled, watch=watch)
    solved.run(iterations)
    return solved


class _Instrumental:
    """Zᵀ W r = b and the prior, a `Problem` of `Descent`; arguments as in `solve`."""

    def __init__(self, whitening: Whitening, prior: Prior, check: Callable[[], None]) -> None:
        self._whitening, self._prior, self._check = whitening, prior, check

    def at(self, x: Array, before: Point | None = None) -> Point:
        """The weighted point at x, shape (P,)."""
        self._check()
        return self._whitening.point(x)

    def lower(self, x: Array, before: Point) -> Point | None:
        """The same unless its objective is higher; at the noise, it is flat."""
        there = self.at(x)
        return there if there.objective <= before.objective else None

    def normal_equations(self, place: Point) -> NormalEquations:
        """With Zᵀ W r − b for the gradient."""
        return place.normal_equations(self._prior)


def refine(
    two_band: TwoBandData,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
) -> Solved:
    """Solve Zᵀ W r = b (plus the prior) starting from the plain fit x.

    Least squares on noisy derivatives is biased, because the noise of r is also in its Jacobian. Instruments
    Z from a narrow band carry little of it, W is the inverse covariance of the propagated noise, and b =
    E[Zᵀ W r] what both still share. Where noise does not explain the residual, a white model error is added.
    """
    solved = solve(
        Whitening(two_band), prior, bounds, x, iterations=MAX_ITERATIONS, impatient=True, report=report
    )
    if solved.consistent:
        return solved
    adapted = Whitening(two_band, adapted=True)
    return solve(adapted, prior, bounds, x, iterations=2 * MAX_ITERATIONS, report=report)
