"""Fits of models to all data of a set, in units of the measurement noise."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import (
    ESTIMATION,
    WIDE_HERTZ,
    Bounds,
    Covariance,
    Point,
    Projection,
    Start,
    TwoBandData,
    UnknownInput,
    WeightingSettings,
    Whitening,
    other_effects,
    solve,
    start_values,
)
from flexviz.analysis.motion import MOTION, Fitted
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Layout

Array = NDArray[np.float64]

# sufficient to distinguish models
SEARCH_WEIGHTING = WeightingSettings(WIDE_HERTZ, {1: 24, 2: 20, 3: 16}, 12, 5, 1e-6)
# at least, where links turn round by jerks: the edge of the filter is known less well than the noise
JERKY_RIDGE = 1e-4
STEPS = 20  # of a fit at most


class Judged(Fitted, Protocol):
    """A fit by whose torque its effects are judged."""

    @property
    def torque(self) -> Array: ...  # transmission torque, shape (N, n) [Nm]

    @property
    def velocity(self) -> Array: ...  # of the motors, shape (N, n) [rad/s]

    @property
    def position(self) -> Array: ...  # of the motors, shape (N, n) [rad]


@dataclass(frozen=True)
class Fit:
    """A model fitted to the fit groups and evaluated on all groups.

    Attributes:
        layout, x: the model and its parameters, shape (P,).
        point: whitened residual and instruments of the fit groups.
        held_out: the same for the validation groups; None without any.
        chi: shape (n,), mean square of the whitened residual of the fit groups.
        chi_held_out: shape (n,), the same for the validation groups; NaN without any.
        objective: Σ_j N log max(χ_j, 1) + cost of nuisance pulses + k log N, over all groups.
        converged: the last step was negligible, or further ones would not improve the objective.
        unbiased: the parameters were estimated with an unknown input: they do not absorb what is missing.
    """

    layout: Layout
    x: Array
    point: Point
    held_out: Point | None
    chi: Array
    chi_held_out: Array
    objective: float
    converged: bool
    unbiased: bool = False

    @property
    def torque(self) -> Array:
        """Transmission torque of the fit groups, shape (N, n) [Nm]."""
        return self.point.torque

    @property
    def velocity(self) -> Array:
        """Of the motors in the fit groups, shape (N, n) [rad/s]."""
        return self.point.narrow_point.signals.theta[1]

    @property
    def position(self) -> Array:
        """Of the motors in the fit groups, shape (N, n) [rad]."""
        return self.point.narrow_point.signals.theta[0]


class FitContext:
    """Data of one diagnosis, shared by all models."""

    def __init__(
        self, measurements: MeasurementSet, layout: Layout, weighing: WeightingSettings = SEARCH_WEIGHTING
    ) -> None:
        self.measurements = measurements
        laws = [EFFECTS[e.effect] for e in layout.effects]
        if any(law.hidden_state and law.where == "link" for law in laws):
            weighing = replace(weighing, ridge=max(weighing.ridge, JERKY_RIDGE), products=True)
        held_out = measurements.validation_groups
        self.two_band = TwoBandData(measurements, measurements.fit_groups, layout, weighing)
        self.validation = TwoBandData(measurements, held_out, layout, weighing) if held_out else None
        bare = layout.with_effects()
        self._start = start_values(measurements, self.two_band.with_layout(bare).narrow)

    def with_unknown_input(self, unknown: UnknownInput) -> FitContext:
        """The same data with an arbitrary torque at one place."""
        other = copy(self)
        other.two_band = self.two_band.with_unknown_input(unknown)
        other.validation = self.validation and self.validation.with_unknown_input(unknown)
        return other

    def start(self, layout: Layout) -> Start:
        """Start values of a layout, with the prior and bounds of the search.

        A rough stiffness given by the set narrows the prior: a joint that hardly deflects, such as a light
        wrist, does not determine its stiffness, and a soft joint resembles other effects, backlash above all.
        """
        start = other_effects(self._start, layout, self.two_band.narrow.signals)
        prior = start.prior
        if self.measurements.initial_stiffness is not None:
            spread = prior.spread.copy()
            spread[layout.compliance] = MOTION.rough_spread * start.x[layout.compliance]
            prior = replace(prior, spread=spread)
        return replace(start, prior=prior, bounds=search_bounds(start, layout))

    def fit(
        self, layout: Layout, x: Array, *, iterations: int = STEPS, near: Fit | None = None,
        settled: float = 0.0, check: Callable[[], None] = lambda: None,
    ) -> Fit:  # fmt: skip
        """Gauss–Newton on Zᵀ W r = b from x, shape (P,), repeated with damping where it leads far uphill.

        `near` is a fit with nearly the same stiffness and motor inertia, whose whiteners can be reused;
        `settled`: change of the objective by a step that ends it; `check` is called before each step and may
        raise to stop.
        """
        whitening = Whitening(self.two_band.with_layout(layout), near and near.point)
        start = self.start(layout)
        given = whitening, start.prior, start.bounds
        solved = solve(*given, x, iterations=iterations, impatient=True, settled=settled, check=check)
        # a far worse end; the objective is twice a log likelihood
        if solved.end.objective > solved.best.objective + 2 * THRESHOLDS.criterion.temperature:
            best = solved.best.x
            again = solve(*given, best, iterations=iterations, damped=True, settled=settled, check=check)
            if again.end.objective < solved.end.objective:
                solved = again
        point, held_out, chi = solved.end, None, np.full(layout.n, np.nan)
        points = [point]
        if self.validation is not None:
            # nothing is fitted to the validation groups: no instruments are needed
            two_band = self.validation.with_layout(layout)
            held_out = Whitening(two_band, near and near.held_out, judging=True).point(point.x)
            points, chi = [point, held_out], held_out.chi
        for one in points:
            one.forget()  # a search keeps many fits
        samples = sum(np.count_nonzero(one.used) for one in points)
        freedom = layout.size - layout.effect_start
        total = sum(one.objective for one in points) + freedom * float(np.log(samples * layout.n))
        converged = solved.converged or solved.ended
        return Fit(layout, point.x, point, held_out, point.chi, chi, total, converged)

    def without_effects(self, fit: Fit) -> Fit:
        """The same parameters without the effects, evaluated only."""
        if not fit.layout.effects:
            return fit
        return self.fit(fit.layout.with_effects(), fit.x[: fit.layout.effect_start], iterations=0, near=fit)

    def covariances(self, fit: Fit) -> tuple[Covariance, Covariance]:
        """Covariance of a fit with what the model lacks, and from the residual's own spectra alone."""
        (found,) = fit.point.stated(self.start(fit.layout).prior, [np.zeros(fit.layout.size, bool)])
        return found

    def projection(self, fit: Fit) -> Projection:
        """Projects out what the parameters of a fit can explain."""
        point, size = fit.point, fit.layout.size
        hessian = point.normal_equations(self.start(fit.layout).prior).hessian
        return Projection(point.r.ravel(), lambda: point.z.reshape(-1, size), hessian)


def search_bounds(start: Start, layout: Layout) -> Bounds:
    """Bounds of the search, wider than those of an identification."""
    lower, upper = start.bounds.lower.copy(), start.bounds.upper.copy()
    # viscous friction may be negative while an effect is missing
    lower[layout.link_viscous] = lower[layout.motor_viscous] = -np.inf
    # an incomplete model may drive a joint towards rigid; the next model has to recover from there
    rough, factor = start.x[layout.compliance], np.exp(ESTIMATION.stiffness_spread)
    lower[layout.compliance], upper[layout.compliance] = rough / factor, rough * factor
    return Bounds(lower, upper).holding(start.x, layout.held)
