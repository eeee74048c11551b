"""Instrumental-variables estimation, without the bias due to filtering and noise.

Two bands: the residual r comes from a wide filter that is exactly flat at the frequencies of the motion, so
that products of filtered signals are correct; it is noisy, but its noise covariance is known (`whitening`).
The Jacobian comes from a narrow filter with little noise and serves as instrument Z. The equation solved is
Zᵀ W r = b, with W the inverse covariance (generalised least squares without errors-in-variables bias) and b
the mean contribution of noise that Z and r share (`instrument_bias`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.covariance import Covariance, sandwich
from flexviz.estimation.descent import Descent, NormalEquations, Reach
from flexviz.estimation.linear_algebra import Bounds
from flexviz.estimation.prior import Prior
from flexviz.estimation.thresholds import ESTIMATION
from flexviz.estimation.two_band import BandEvaluation, TwoBandData
from flexviz.estimation.weighted_point import (
    EarlyWhitening,
    Point,
    Whitening,
    first_model_error,
)

Array = NDArray[np.float64]

MAX_HALVINGS = 5  # lengths of a step that are tried in a damped fit
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
    normal: NormalEquations
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
        damped: halve steps that raise the objective, and end if that does not help. Off by default: Zᵀ W r is
            not exactly the gradient of the objective, so that steps towards the solution may lead slightly
            uphill.
        beat: objective to reach; the fit ends where its next steps are too short for that.
        patience: steps without a better objective that end a fit far above the noise. There Zᵀ W r = b and
            the minimum of the objective differ, and steps of many standard deviations say nothing.
        check: called before each point; may raise to stop.
        report: called with x, cost and step length of each step; may raise to stop.
    """
    problem = _Instrumental(whitening, prior, check)
    outlook = _Outlook(beat, patience)

    def watch(descent: Descent[Point]) -> bool:
        point = descent.place
        report(point.x, 0.5 * float((point.r**2).sum()), descent.length)
        return outlook.hopeless(point, descent.best, descent.length)

    descent = Descent(
        problem, Reach(bounds, prior.feasible, prior.layout.compliance), problem.at(bounds.clip(x)),
        negligible=negligible, least=least, halvings=MAX_HALVINGS if damped else 0, watch=watch,
    )  # fmt: skip
    descent.run(iterations)
    return Solved(
        descent.place, descent.best, descent.normal, descent.at_bound, descent.converged, descent.ended
    )


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
