"""Fits of one model to all data, in units of the measurement noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Chain, Equation, Layout, Signals, build_signals
from flexviz.estimation import (
    WIDE_HERTZ,
    Bounds,
    Point,
    Prior,
    Start,
    TwoBandData,
    bounded_step,
    compensated_score,
    evaluated,
    feasible_step,
    gauss_newton,
    other_effects,
    start_values,
    weighted_point,
)
from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import ButterworthZeroPhase

Array = NDArray[np.float64]

PLAIN_HERTZ = 7.0
STIFFNESS_KNOWN = 0.5  # relative standard deviation of 1/K where the set says roughly how stiff joints are
STIFFNESS_REACH = 20.0  # a stiffness is sought within this factor of its rough value
NEGLIGIBLE = 0.05  # [standard deviations] a step that ends a fit
WORSE = 100.0  # rise of the objective over the best on the way after which a fit is damped
HALVINGS = 4  # of a step
NOISE_MOVED = 0.01  # change of the noise's shape after which the residual is whitened anew
EFFECT_MOVED = 0.1  # relative change of an effect after which its reversals are looked for anew


@dataclass(frozen=True)
class WeightingSettings:
    """How closely the weighting follows the noise's spectrum: closer is nearer to the most that the data say,
    but a trace of a law that is only nearly right weighs more, too.

    Attributes:
        hertz: band of the residual.
        orders: number of joints -> samples before each that predict it.
        long_order: the same for robots with more joints.
        every: how often the prediction is solved for [samples].
        ridge: of the residual's noise variance, in the prediction.
    """

    hertz: float
    orders: Mapping[int, int]
    long_order: int
    every: int
    ridge: float

    def two_band(self, measurements: MeasurementSet, groups: list[Group], layout: Layout) -> TwoBandData:
        """The data weighted so."""
        two_band = TwoBandData(measurements, groups, layout, self.hertz)
        two_band.order, two_band.every = self.orders.get(layout.n, self.long_order), self.every
        two_band.ridge = self.ridge
        return two_band


SEARCH_WEIGHTING = WeightingSettings(WIDE_HERTZ, {1: 24, 2: 20, 3: 16}, 12, 5, 1e-6)


@dataclass(frozen=True)
class Fit:
    """A model fitted to the fit groups and judged on all.

    Attributes:
        layout, x: the model.
        point: whitened residual and instruments of the fit groups there.
        held_out: the same of the validation groups; None without any.
        chi: shape (n,), mean square of the whitened residual of the fit groups.
        chi_held_out: shape (n,); NaN without validation groups.
        objective: Σ_j N log max(χ_j, 1) + the cost of unknown pulses + k log N, over all groups.
        noise_objective: its first part alone.
        converged: the last step was negligible.
        noise_at: the noise's shape for which the whiteners of point and held_out were made.
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


class FitContext:
    """The data of one diagnosis, shared by every model that is tried."""

    def __init__(
        self, measurements: MeasurementSet, layout: Layout, weighing: WeightingSettings = SEARCH_WEIGHTING
    ) -> None:
        self.measurements = measurements
        fit = [g for g in measurements.groups if not g.validation]
        held_out = [g for g in measurements.groups if g.validation]
        self.fit_groups, self.held_out_groups = fit, held_out
        self.two_band = weighing.two_band(measurements, fit, layout)
        self.validation = weighing.two_band(measurements, held_out, layout) if held_out else None
        bare = Layout(layout.joints)
        self._start = start_values(measurements, self.two_band.with_layout(bare).narrow)
        self._plain: tuple[Signals, Start] | None = None
        self._plain_shared: dict[object, Any] = {}

    @property
    def rough_compliance(self) -> Array:
        """1/K of the set's rough stiffness, or of a guess, shape (n,)."""
        return self._start.x[self._start.prior.layout.compliance]

    def with_tolerance(self, tolerance: Array) -> FitContext:
        """The same data with a white model error, shape (n,) [Nm²], beside the measurement noise."""
        other = copy(self)
        other.two_band = copy(self.two_band)
        other.two_band.tolerance = tolerance
        if self.validation is not None:
            other.validation = copy(self.validation)
            other.validation.tolerance = tolerance
        return other

    def prior_and_bounds(self, layout: Layout) -> tuple[Prior, Bounds]:
        """Prior and bounds of a layout.

        A joint that hardly deflects, such as a light wrist, says nothing of its stiffness, and a soft joint
        imitates much, a gap above all.
        """
        start = other_effects(self._start, layout, self.two_band.narrow.signals)
        prior = start.prior
        if self.measurements.initial_stiffness is not None:
            spread = prior.spread.copy()
            spread[layout.compliance] = STIFFNESS_KNOWN * start.x[layout.compliance]
            prior = replace(prior, spread=spread)
        return prior, search_bounds(start, layout)

    def fit(
        self,
        layout: Layout,
        x: Array,
        *,
        iterations: int = 10,
        check: Callable[[], None] = lambda: None,
        near: Fit | None = None,
    ) -> Fit:
        """Gauss–Newton on Zᵀ W r = b from x.

        Args:
            layout: the model's effects.
            x: start, shape (P,).
            iterations: at most this many steps.
            check: called before each step; may raise to stop.
            near: another model's fit with nearly the same stiffnesses and motor inertias as x, whose
                whiteners may be taken.
        """
        descent = _Descent(self, layout, near, check)
        x, point, converged, best = descent.run(x, iterations, damped=False)
        if _objective(point) > best[0] + WORSE and iterations:
            # the steps led far uphill from where they had been
            again = descent.run(best[1], iterations, damped=True)
            if _objective(again[1]) < _objective(point):
                x, point, converged, _ = again
        return self._judged(layout, x, point, converged, near, descent.whitened.noise_at)

    def _judged(
        self, layout: Layout, x: Array, point: Point, converged: bool, near: Fit | None, noise_at: Array
    ) -> Fit:
        total, noise = _objective(point), _noise_objective(point)
        held_out, chi_held_out, noise_there = None, np.full(layout.n, np.nan), noise_at
        samples = np.count_nonzero(point.used)
        if self.validation is not None:
            whitened = _Whitened(layout, near, held_out=True)
            held_out = whitened.point(self.validation.with_layout(layout), x)
            noise_there = whitened.noise_at
            chi_held_out = _chi(held_out)
            total += _objective(held_out)
            noise += _noise_objective(held_out)
            samples += np.count_nonzero(held_out.used)
        freedom = layout.size - layout.effect_start
        total += freedom * float(np.log(samples * layout.n))
        return Fit(
            layout, x, point, held_out, _chi(point), chi_held_out, total, noise, converged,
            (noise_at, noise_there),
        )  # fmt: skip

    def without_effects(self, fit: Fit) -> Fit:
        """The same values without the effects: what these take is what their laws may leave traces of."""
        if not fit.layout.effects:
            return fit
        return self.fit(Layout(fit.layout.joints), fit.x[: fit.layout.effect_start], iterations=0, near=fit)

    def plain_fit(self, layout: Layout, x: Array, check: Callable[[], None] = lambda: None) -> Array:
        """A plain fit of a layout: weighted by its own residual, it finds its way from far off.

        Args:
            layout: the model's effects.
            x: the effects' values to start from; everything else starts from the rigid fit, because another
                model's stiffness may be anywhere.
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
        _, bounds = self.prior_and_bounds(layout)
        solution = gauss_newton(
            equation, start.prior, bounds, bounds.clip(begin), reweightings=2, max_iterations=14,
            report=lambda *_: check(),
        )  # fmt: skip
        return solution.x

    def chain(self, fit: Fit) -> Chain:
        """How changes of s and q move the residual at a fit."""
        lay = fit.layout
        return Chain(fit.x[lay.compliance], fit.x[lay.link_viscous], fit.point.narrow.link)


def search_bounds(start: Start, layout: Layout) -> Bounds:
    """The diagnosis' own bounds of a layout."""
    lower, upper = start.bounds.lower.copy(), start.bounds.upper.copy()
    # viscous friction may be negative while something is still missing
    lower[layout.link_viscous] = lower[layout.motor_viscous] = -np.inf
    # a wrong model may want a rigid joint; the next one has to find its way back
    rough = start.x[layout.compliance]
    lower[layout.compliance], upper[layout.compliance] = rough / STIFFNESS_REACH, rough * STIFFNESS_REACH
    return Bounds(lower, upper)


def _chi(point: Point) -> Array:
    return np.sum(point.r**2, axis=0) / np.count_nonzero(point.used)


def _noise_objective(point: Point) -> float:
    return np.count_nonzero(point.used) * float(np.log(np.maximum(_chi(point), 1.0)).sum())


def _objective(point: Point) -> float:
    return _noise_objective(point) + sum(m.log_determinant for m in point.weightings)


class _Descent:
    """Gauss–Newton steps of one model."""

    def __init__(
        self, context: FitContext, layout: Layout, near: Fit | None, check: Callable[[], None]
    ) -> None:
        self.layout, self.check = layout, check
        self.two_band = context.two_band.with_layout(layout)
        self.prior, self.bounds = context.prior_and_bounds(layout)
        self.whitened = _Whitened(layout, near)

    def run(
        self, x: Array, iterations: int, damped: bool
    ) -> tuple[Array, Point, bool, tuple[float, Array, Point]]:
        """Where the steps end, whether that is for good, and the best (objective, x, point) on the way.

        Args:
            x: start, shape (P,).
            iterations: at most this many steps.
            damped: a step that raises the objective is halved. The instruments do not follow the objective's
                slope exactly, so that steps may well lead a little uphill on the way to a better place.
        """
        prior, bounds, size = self.prior, self.bounds, self.layout.size
        x = bounds.clip(x)
        point, converged = None, False
        best: tuple[float, Array, Point] | None = None
        step, halvings = np.zeros(size), 0
        for iteration in range(iterations + 1):
            self.check()
            point = self.whitened.point(self.two_band, x)
            objective = _objective(point)
            if damped and best is not None and objective > best[0] and halvings < HALVINGS:
                halvings += 1
                step = 0.5 * step
                x = feasible_step(prior, bounds, best[1], step)
                continue
            if best is None or objective < best[0]:
                best = objective, x, point
            halvings = 0
            gradient, prior_hessian = prior.gradient_and_hessian(x)
            flat = point.z.reshape(-1, size)
            hessian = flat.T @ flat + prior_hessian
            step, _ = bounded_step(gradient + compensated_score(self.two_band, point), hessian, x, bounds)
            length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
            converged = length < NEGLIGIBLE and iteration >= 1
            if converged or iteration == iterations:
                break
            x = feasible_step(prior, bounds, x, step)
        assert best is not None and point is not None
        if not converged:
            x, point = best[1], best[2]
        return x, point, converged, best


class _Whitened:
    """Whitened points along a fit; the noise's way is followed anew only where it has changed."""

    def __init__(self, layout: Layout, near: Fit | None, held_out: bool = False) -> None:
        self._layout, self._held_out = layout, held_out
        self._whiteners, self._shared, self.noise_at = None, [], np.zeros(0)
        point = None if near is None else near.held_out if held_out else near.point
        if near is not None and point is not None:
            self._whiteners, self.noise_at = point.whiteners, near.noise_at[held_out]
        self._metrics, self._effects_at = None, np.zeros(0)

    def point(self, two_band: TwoBandData, x: Array) -> Point:
        residual, narrow = evaluated(two_band, x)
        noise = two_band.noise_shape(x, narrow.link)
        if self._whiteners is None or np.max(np.abs(noise - self.noise_at)) > NOISE_MOVED:
            self._whiteners, self._metrics, self.noise_at = None, None, noise
        effects = x[self._layout.effect_start :]
        if self._metrics is not None and effects.size:
            scale = np.abs(effects) + np.abs(self._effects_at) + 1e-300
            if np.max(np.abs(effects - self._effects_at) / scale) > 0.5 * EFFECT_MOVED:
                self._metrics = None
        if self._whiteners is None:
            self._whiteners, self._shared = two_band.whiteners(x, narrow.link), []
        if not self._shared and not self._held_out:  # nothing is fitted to what is held out
            self._shared = two_band.instrument_bias(x, narrow.link, self._whiteners)
        if self._metrics is None:
            self._metrics, self._effects_at = two_band.weightings(x, narrow, self._whiteners), effects.copy()
        return weighted_point(two_band, residual, narrow, self._metrics, self._shared)
