"""Instrumental-variables estimation, without the bias due to filtering and noise.

Two bands: the residual r comes from a wide filter that is exactly flat at the frequencies of the motion, so
that products of filtered signals are correct; it is noisy, but its noise covariance is known (`whitening`).
The Jacobian comes from a narrow filter with little noise and serves as instrument Z. The equation solved is
Zᵀ W r = b, with W the inverse covariance (generalised least squares without errors-in-variables bias) and b
the mean contribution of noise that Z and r share (`instrument_bias`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

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
PREDICTED = 4.0  # decrease of Σ r² over all further steps, relative to that predicted for the next one
IMPROVED = 0.997  # factor on the objective, below which a step has improved it
MAX_MODEL_ERROR_FITS = 8  # fits while the model error is adapted to the residual
FEW_STEPS = 3  # of these, while the model error is far too small


@dataclass(frozen=True, eq=False)
class Solved:
    """Final state of the solver.

    Attributes:
        point: last point.
        best: point of least objective.
        normal: normal equations of the last full step.
        at_bound: shape (P,), parameters held at a bound by this step.
        converged: this step was negligible.
        hopeless: further steps are not worth while (`beat`, `patience`).
    """

    point: Point
    best: Point
    normal: WeightedNormalEquations
    at_bound: NDArray[np.bool_]
    converged: bool
    hopeless: bool = False

    @property
    def end(self) -> Point:
        """The last point if converged, else the best one."""
        return self.point if self.converged else self.best

    def covariance(self, from_noise: bool) -> Covariance:
        """Covariance from the noise model or from the spectra of the residual."""
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
    beat: float = np.inf,
    patience: int | None = None,
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
        negligible: step length that ends the fit [standard deviations].
        least: minimum number of steps.
        damped: halve steps that raise the objective. Off by default: Zᵀ W r is not exactly the gradient of
            the objective, so that steps towards the solution may lead slightly uphill.
        beat: objective to reach; the fit ends where its next steps are too short for that.
        patience: steps without a better objective that end a fit far above the noise. There Zᵀ W r = b and
            the minimum of the objective differ, and steps of many standard deviations say nothing.
        check: called before each point; may raise to stop.
        report: called with x, cost and step length of each step; may raise to stop.
    """
    x = bounds.clip(x)
    solved, step, halvings = None, np.zeros(len(x)), 0
    outlook = _Outlook(beat, patience)
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
        solved = replace(solved, hopeless=outlook.hopeless(point, best, length))
        if solved.converged or solved.hopeless or iteration == iterations:
            break
        x = feasible_step(prior, bounds, x, step)
    assert solved is not None
    return solved


class _Outlook:
    """Whether further steps of a fit are worth while; arguments as in `solve`."""

    def __init__(self, beat: float, patience: int | None) -> None:
        self._beat, self._patience = beat, patience
        self._idle, self._least = 0, np.inf

    def hopeless(self, point: Point, best: Point, length: float) -> bool:
        """Whether to end at a point from which the next step has this length [standard deviations]."""
        self._idle = 0 if best.objective < IMPROVED * self._least else self._idle + 1
        self._least = best.objective
        impatient = self._patience is not None and self._idle >= self._patience
        if impatient and float(point.chi.mean()) > ESTIMATION.far_above_noise:
            return True
        return bool(point.objective_after(PREDICTED * length**2) > self._beat)


def feasible_step(prior: Prior, bounds: Bounds, x: Array, step: Array) -> Array:
    """The first physically consistent point of x + step, x + step/2, …; x if there is none."""
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
        covariance: covariance of the parameters.
        chi: shape (n,), mean square of the whitened residual of each joint.
        converged: the last step was negligible.
        at_bound: shape (P,).
        model_error: shape (n,), standard deviation of the model error that was added to the noise [Nm].
    """

    x: Array
    covariance: Covariance
    chi: Array
    converged: bool
    at_bound: NDArray[np.bool_]
    model_error: Array

    @property
    def chi_square(self) -> float:
        """Mean of `chi` over the joints."""
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
    """Solve Zᵀ W r = b (plus the prior) starting from the plain fit x.

    If the residual is far above the measurement noise, a white model error is added to the noise, large
    enough to explain the residual: the noise alone would give misleading weights.
    """

    def run(
        data: TwoBandData, x: Array, after: BandEvaluation | None, iterations: int
    ) -> tuple[Refined, BandEvaluation]:
        whitening = EarlyWhitening(data, after)
        negligible = ESTIMATION.negligible_step
        solved = solve(
            whitening, prior, bounds, x,
            iterations=iterations, negligible=negligible, least=EarlyWhitening.STEPS, report=report,
        )  # fmt: skip
        chi = solved.point.chi
        covariance = solved.covariance(from_noise=float(np.mean(chi)) < ESTIMATION.noise_explains)
        added = np.sqrt(data.noise_model.model_error)
        refined = Refined(solved.point.x, covariance, chi, solved.converged, solved.at_bound, added)
        assert whitening.evaluation is not None
        return refined, whitening.evaluation

    refined, last = run(two_band, x, None, max_iterations)
    if refined.chi_square <= ESTIMATION.consistent:
        return refined
    error = first_model_error(last.narrow_point.motor_side(x)[0][0])
    for index in range(MAX_MODEL_ERROR_FITS):
        near = index > 0 and bool(np.all(refined.chi < ESTIMATION.consistent))
        last_time = index == MAX_MODEL_ERROR_FITS - 1
        iterations = max_iterations if near or last_time else min(FEW_STEPS, max_iterations)
        refined, last = run(two_band.with_model_error(error), x, last, iterations)
        x = refined.x
        if iterations == max_iterations and np.all(refined.chi < ESTIMATION.model_error_settled):
            break
        error = error * np.maximum(refined.chi, 0.5)
    return refined
