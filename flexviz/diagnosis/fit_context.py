"""Fits of models to all data of a set, in units of the measurement noise."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS
from flexviz.equation import Chain, Equation, Layout, Signals, build_signals
from flexviz.estimation import (
    WIDE_HERTZ,
    Bounds,
    Covariance,
    Point,
    Projection,
    Solved,
    Start,
    TrackingWhitening,
    TwoBandData,
    UnknownInput,
    WeightingSettings,
    Whitener,
    gauss_newton,
    other_effects,
    sandwich,
    solve,
    start_values,
)
from flexviz.measurements import MeasurementSet
from flexviz.observers import ButterworthZeroPhase

Array = NDArray[np.float64]

PLAIN_HERTZ = 7.0
COMPLIANCE_SPREAD = 0.5  # relative prior standard deviation of 1/K around the set's rough stiffness
STIFFNESS_RANGE = 20.0  # a stiffness is bounded to within this factor of its rough value
NEGLIGIBLE_STEP = 0.05  # [standard deviations] step length that ends a fit
PATIENCE = 2  # steps without a better objective that end a fit far above the noise
DAMPING_RISE = 100.0  # rise of the objective above the best point after which a fit is repeated with damping

# sufficient to distinguish models
SEARCH_WEIGHTING = WeightingSettings(WIDE_HERTZ, {1: 24, 2: 20, 3: 16}, 12, 5, 1e-6)
# at least, where links turn round by jerks: the edge of the filter is known less well than the noise
JERKY_RIDGE = 1e-4


class Fitted(Protocol):
    """A model with its parameters."""

    @property
    def layout(self) -> Layout: ...

    @property
    def x(self) -> Array: ...


class Judged(Fitted, Protocol):
    """A fit by whose torque its effects are judged."""

    @property
    def torque(self) -> Array:
        """Transmission torque, shape (N, n) [Nm]."""
        ...

    @property
    def velocity(self) -> Array:
        """Of the motors, shape (N, n) [rad/s]."""
        ...


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
        noise_objective: the first term alone.
        converged: the last step was negligible, or further ones would not improve the objective.
        noise_at: noise shapes for which the whiteners of `point` and `held_out` were computed.
        covariance: of the parameters, of fits that are only reported (`reported`).
        unbiased: the parameters were estimated beside an unknown input: they do not absorb what is missing.
    """

    layout: Layout
    x: Array
    point: Point
    held_out: Point | None
    chi: Array
    chi_held_out: Array
    objective: float
    noise_objective: float
    converged: bool
    noise_at: tuple[Array, Array]
    covariance: Covariance | None = None
    unbiased: bool = False

    def reported(self, covariance: Covariance) -> Fit:
        """The fit without what another fit or its covariance would need, most of its memory."""
        return replace(self, point=replace(self.point, weightings=[]), held_out=None, covariance=covariance)

    @property
    def torque(self) -> Array:
        """Transmission torque of the fit groups, shape (N, n) [Nm]."""
        return self.point.torque

    @property
    def velocity(self) -> Array:
        """Of the motors in the fit groups, shape (N, n) [rad/s]."""
        return self.point.narrow_point.signals.theta[1]


class FitContext:
    """Data of one diagnosis, shared by all models."""

    def __init__(
        self, measurements: MeasurementSet, layout: Layout, weighing: WeightingSettings = SEARCH_WEIGHTING
    ) -> None:
        self.measurements = measurements
        fit = [g for g in measurements.groups if not g.validation]
        held_out = [g for g in measurements.groups if g.validation]
        self.fit_groups, self.held_out_groups = fit, held_out
        laws = [EFFECTS[e.effect] for e in layout.effects]
        if any(law.hidden_state and law.where == "link" for law in laws):
            weighing = replace(weighing, ridge=max(weighing.ridge, JERKY_RIDGE), products=True)
        self.two_band = TwoBandData(measurements, fit, layout, weighing)
        self.validation = TwoBandData(measurements, held_out, layout, weighing) if held_out else None
        bare = Layout(layout.joints)
        self._start = start_values(measurements, self.two_band.with_layout(bare).narrow)
        self._plain: tuple[Signals, Start] | None = None
        self._plain_shared: dict[object, Any] = {}

    @property
    def rough_compliance(self) -> Array:
        """1/K from the set's rough stiffness, or else a guess, shape (n,) [rad/Nm]."""
        return self._start.x[self._start.prior.layout.compliance]

    def with_model_error(self, variance: Array) -> FitContext:
        """The same data with white model error of variance (n,) [Nm²] added to the measurement noise."""
        return self._changed(lambda data: data.with_model_error(variance))

    def with_unknown_input(self, unknown: UnknownInput) -> FitContext:
        """The same data beside an arbitrary torque at one place."""
        return self._changed(lambda data: data.with_unknown_input(unknown))

    def with_products(self) -> FitContext:
        """The same data with products of signals that are formed before they are filtered."""
        return self._changed(lambda data: data.with_products())

    def _changed(self, change: Callable[[TwoBandData], TwoBandData]) -> FitContext:
        other = copy(self)
        other.two_band = change(self.two_band)
        if self.validation is not None:
            other.validation = change(self.validation)
        return other

    def start(self, layout: Layout) -> Start:
        """Start values of a layout, with the prior and bounds of the search.

        A rough stiffness given by the set narrows the prior: a joint that hardly deflects, such as a light
        wrist, does not determine its stiffness, and a soft joint imitates other effects, backlash above all.
        """
        start = other_effects(self._start, layout, self.two_band.narrow.signals)
        prior = start.prior
        if self.measurements.initial_stiffness is not None:
            spread = prior.spread.copy()
            spread[layout.compliance] = COMPLIANCE_SPREAD * start.x[layout.compliance]
            prior = replace(prior, spread=spread)
        return replace(start, prior=prior, bounds=search_bounds(start, layout))

    def fit(
        self,
        layout: Layout,
        x: Array,
        *,
        iterations: int = 10,
        check: Callable[[], None] = lambda: None,
        near: Fit | None = None,
        beat: float = np.inf,
        damped: bool = False,
    ) -> Fit:
        """Gauss–Newton on Zᵀ W r = b from x.

        Args:
            layout: the model.
            x: start, shape (P,).
            iterations: maximum number of steps.
            check: called before each step; may raise to stop.
            near: fit with nearly the same stiffness and motor inertia, whose whiteners can be reused.
            beat: objective of the fit groups to reach; a fit that will not reach it ends early.
            damped: halve steps that lead uphill from the beginning.
        """
        two_band = self.two_band.with_layout(layout)
        whitening = TrackingWhitening(two_band, _noise_of(near))
        start = self.start(layout)

        def run(x: Array, damped: bool) -> Solved:
            return solve(
                whitening, start.prior, start.bounds, x,
                iterations=iterations, negligible=NEGLIGIBLE_STEP, least=1, damped=damped, beat=beat,
                patience=None if damped else PATIENCE, check=check,
            )  # fmt: skip

        solved = run(x, damped)
        if not damped and solved.end.objective > solved.best.objective + DAMPING_RISE and iterations:
            # the steps led far uphill from the best point
            again = run(solved.best.x, damped=True)
            if again.end.objective < solved.end.objective:
                solved = again
        finished = solved.converged or solved.hopeless
        return self._judged(layout, solved.end, finished, near, whitening.noise_at)

    def _judged(
        self, layout: Layout, point: Point, converged: bool, near: Fit | None, noise_at: Array
    ) -> Fit:
        point.forget()  # a search keeps many fits
        x, total, noise = point.x, point.objective, point.noise_objective
        held_out, chi_held_out, noise_there = None, np.full(layout.n, np.nan), noise_at
        samples = np.count_nonzero(point.used)
        if self.validation is not None:
            two_band = self.validation.with_layout(layout)
            # nothing is fitted to the validation groups: no instruments are needed
            whitening = TrackingWhitening(two_band, _noise_of(near, held_out=True), judging=True)
            held_out = whitening.point(x)
            held_out.forget()
            noise_there = whitening.noise_at
            chi_held_out = held_out.chi
            total += held_out.objective
            noise += held_out.noise_objective
            samples += np.count_nonzero(held_out.used)
        freedom = layout.size - layout.effect_start
        total += freedom * float(np.log(samples * layout.n))
        return Fit(
            layout, x, point, held_out, point.chi, chi_held_out, total, noise, converged,
            (noise_at, noise_there),
        )  # fmt: skip

    def without_effects(self, fit: Fit) -> Fit:
        """The same parameters without the effects, evaluated only."""
        if not fit.layout.effects:
            return fit
        return self.fit(Layout(fit.layout.joints), fit.x[: fit.layout.effect_start], iterations=0, near=fit)

    def plain_fit(self, layout: Layout, x: Array, check: Callable[[], None] = lambda: None) -> Array:
        """Plain fit, weighted by its own residual, which converges from distant start values.

        Args:
            layout: the model.
            x: shape (P,), start of the effects' parameters; all others start from the rigid fit, because the
                stiffness of another model may be far off.
            check: called after each step; may raise to stop.

        Returns:
            shape (P,).
        """
        if self._plain is None:
            observer = ButterworthZeroPhase(2 * np.pi * PLAIN_HERTZ)
            signals = build_signals(self.measurements, self.fit_groups, observer)
            bare = Equation(self.measurements.robot, signals, Layout(layout.joints), self._plain_shared)
            self._plain = signals, start_values(self.measurements, bare)
        signals, bare_start = self._plain
        equation = Equation(self.measurements.robot, signals, layout, self._plain_shared)
        start = other_effects(bare_start, layout, signals)
        begin = start.x.copy()
        begin[layout.effect_start :] = x[layout.effect_start :]
        bounds = self.start(layout).bounds
        solution = gauss_newton(
            equation, start.prior, bounds, bounds.clip(begin), reweightings=2, max_iterations=14,
            report=lambda *_: check(),
        )  # fmt: skip
        return solution.x

    def covariance(self, fit: Fit) -> Covariance:
        """Covariance of a fit, from the residual's own spectra."""
        if fit.covariance is not None:
            return fit.covariance
        normal = fit.point.normal_equations(self.start(fit.layout).prior)
        return sandwich(normal.information, fit.point.score_covariance(), normal.prior_hessian)

    def projection(self, fit: Fit) -> Projection:
        """Projects out what the parameters of a fit can explain."""
        point, size = fit.point, fit.layout.size
        flat = point.z.reshape(-1, size)
        hessian = flat.T @ flat + self.start(fit.layout).prior.gradient_and_hessian(fit.x)[1]
        return Projection(point.r.ravel(), lambda: point.z.reshape(-1, size), hessian)

    def chain(self, fit: Fit) -> Chain:
        """Sensitivity of the residual to s and q at a fit."""
        lay = fit.layout
        return Chain(fit.x[lay.compliance], fit.x[lay.link_viscous], fit.point.link)


def search_bounds(start: Start, layout: Layout) -> Bounds:
    """Bounds of the search, wider than those of an identification."""
    lower, upper = start.bounds.lower.copy(), start.bounds.upper.copy()
    # viscous friction may be negative while an effect is missing
    lower[layout.link_viscous] = lower[layout.motor_viscous] = -np.inf
    # an incomplete model may drive a joint towards rigid; the next model has to recover from there
    rough = start.x[layout.compliance]
    lower[layout.compliance], upper[layout.compliance] = rough / STIFFNESS_RANGE, rough * STIFFNESS_RANGE
    return Bounds(lower, upper)


def _noise_of(near: Fit | None, held_out: bool = False) -> tuple[list[Whitener], Array] | None:
    """Whiteners of a fit and the noise shape for which they were computed."""
    point = None if near is None else near.held_out if held_out else near.point
    return None if near is None or point is None else (point.whiteners, near.noise_at[held_out])
