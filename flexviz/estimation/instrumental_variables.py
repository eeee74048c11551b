"""Instrumental variables: a fit without the bias that filtering and noise give to the plain one.

Two bands. The residual r comes from a wide filter that is exactly flat where the robot moves, so that
products of filtered signals are right; it is full of noise, but that noise's covariance is known
(`whitening`). The Jacobian comes from a narrow filter, so that its noise is small: it serves as instrument Z.
Solved is Zᵀ W r = b with W the inverse covariance — generalised least squares without the errors-in-variables
bias of one band — and b the mean contribution of noise that Z and r share (`instrument_bias`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.covariance import Covariance, sandwich
from flexviz.estimation.linear_algebra import Bounds, bounded_step
from flexviz.estimation.prior import Prior
from flexviz.estimation.thresholds import ESTIMATION
from flexviz.estimation.two_band import BandEvaluation, TwoBandData
from flexviz.estimation.weighted_point import (
    EarlyWhitening,
    Point,
    WeightedNormalEquations,
    Whitening,
    first_model_error,
)

Array = NDArray[np.float64]

MAX_HALVINGS = 4  # of a step in a damped fit
MAX_MODEL_ERRORS = 8  # fits until the model error explains the residual


@dataclass(frozen=True, eq=False)
class Solved:
    """Where the solver ended.

    Attributes:
        point: the last one.
        best: the one of least objective.
        normal: the normal equations of the last full step.
        at_bound: shape (P,), parameters that this step held at a bound.
        converged: that step was negligible.
    """

    point: Point
    best: Point
    normal: WeightedNormalEquations
    at_bound: NDArray[np.bool_]
    converged: bool

    @property
    def end(self) -> Point:
        """The last point where the solver converged, else the best one."""
        return self.point if self.converged else self.best

    def covariance(self, from_noise: bool) -> Covariance:
        """From the noise model, or from the residual's own spectra."""
        score = self.point.noise_score_covariance() if from_noise else self.point.score_covariance()
        return sandwich(self.normal.information, score, self.normal.prior_hessian, self.at_bound)


def solve(
    whitening: Whitening,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    iterations: int,
    negligible: float,
    least: int = 0,
    damped: bool = False,
    check: Callable[[], None] = lambda: None,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
) -> Solved:
    """Gauss–Newton on Zᵀ W r = b and the prior.

    Args:
        whitening: makes the weighted points.
        prior: of the parameters.
        bounds: of the parameters.
        x: start, shape (P,).
        iterations: at most this many steps.
        negligible: length of a step that ends the fit [standard deviations].
        least: steps before it may end.
        damped: a step that raises the objective is halved. The instruments do not follow the objective's
            slope exactly, so that steps may well lead a little uphill on the way to a better place.
        check: called before each point; may raise to stop.
        report: called with x, cost and step length of each step; may raise to stop.
    """
    x = bounds.clip(x)
    solved, step, halvings = None, np.zeros(len(x)), 0
    for iteration in range(iterations + 1):
        check()
        point = whitening.point(x)
        best = point if solved is None or point.objective < solved.best.objective else solved.best
        uphill = point.objective > best.objective
        if damped and solved is not None and uphill and halvings < MAX_HALVINGS:
            halvings += 1
            step = 0.5 * step
            x = feasible_step(prior, bounds, best.x, step)
            solved = Solved(point, best, solved.normal, solved.at_bound, False)
            continue
        halvings = 0
        normal = point.normal_equations(prior)
        hessian = normal.hessian
        step, at_bound = bounded_step(normal.gradient, hessian, x, bounds)
        length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
        report(x, 0.5 * float((point.r**2).sum()), length)
        solved = Solved(point, best, normal, at_bound, length < negligible and iteration >= least)
        if solved.converged or iteration == iterations:
            break
        x = feasible_step(prior, bounds, x, step)
    assert solved is not None
    return solved


def feasible_step(prior: Prior, bounds: Bounds, x: Array, step: Array) -> Array:
    """The first of x + step, x + step/2, … at which every body can exist; x where none is."""
    length = 1.0
    compliance = prior.layout.compliance
    for _ in range(30):
        trial = bounds.clip(x + length * step)
        trial[compliance] = np.clip(trial[compliance], 0.2 * x[compliance], 5 * x[compliance])
        if prior.feasible(trial):
            return trial
        length *= 0.5
    return x


@dataclass(frozen=True, eq=False)
class Refined:
    """Result of the instrumental-variables refinement.

    Attributes:
        x: shape (P,).
        covariance: of the parameters.
        chi: shape (n,), mean square of each joint's whitened residual.
        converged: the last step was negligible.
        at_bound: shape (P,).
    """

    x: Array
    covariance: Covariance
    chi: Array
    converged: bool
    at_bound: NDArray[np.bool_]

    @property
    def chi_square(self) -> float:
        """Mean over the joints."""
        return float(np.mean(self.chi))


def refine(
    two_band: TwoBandData,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    max_iterations: int = 12,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
) -> Refined:
    """Solve Zᵀ W r = b (plus the prior) from the plain fit's x.

    Where the residual is far above the measurement noise the model, not the noise, is what is wrong: a white
    model error is then added to the noise, as large as it takes to explain the residual, so that nothing is
    weighted by a noise that does not matter.
    """

    def run(data: TwoBandData, x: Array, after: BandEvaluation | None) -> tuple[Refined, BandEvaluation]:
        whitening = EarlyWhitening(data, after)
        negligible = ESTIMATION.negligible_step
        solved = solve(
            whitening, prior, bounds, x,
            iterations=max_iterations, negligible=negligible, least=EarlyWhitening.STEPS, report=report,
        )  # fmt: skip
        chi = solved.point.chi
        covariance = solved.covariance(from_noise=float(np.mean(chi)) < ESTIMATION.noise_explains)
        refined = Refined(solved.point.x, covariance, chi, solved.converged, solved.at_bound)
        assert whitening.evaluation is not None
        return refined, whitening.evaluation

    refined, last = run(two_band, x, None)
    if refined.chi_square <= ESTIMATION.consistent:
        return refined
    error = first_model_error(last.narrow_point.motor_side(x)[0][0])
    for _ in range(MAX_MODEL_ERRORS):
        refined, last = run(two_band.with_model_error(error), x, last)
        x = refined.x
        if np.all(refined.chi < ESTIMATION.model_error_settled):
            break
        error = error * np.maximum(refined.chi, 0.5)
    return refined
