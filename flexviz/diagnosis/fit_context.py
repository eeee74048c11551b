"""Fits of one model to all data, in units of the measurement noise."""

from __future__ import annotations

from collections.abc import Callable
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
    Solved,
    Start,
    TrackingWhitening,
    TwoBandData,
    WeightingSettings,
    Whitener,
    gauss_newton,
    other_effects,
    solve,
    start_values,
)
from flexviz.measurements import MeasurementSet
from flexviz.observers import ButterworthZeroPhase

Array = NDArray[np.float64]

PLAIN_HERTZ = 7.0
STIFFNESS_KNOWN = 0.5  # relative standard deviation of 1/K where the set says roughly how stiff joints are
STIFFNESS_REACH = 20.0  # a stiffness is sought within this factor of its rough value
NEGLIGIBLE = 0.05  # [standard deviations] a step that ends a fit
WORSE = 100.0  # rise of the objective over the best on the way after which a fit is damped

# enough to tell models apart
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
        self.two_band = TwoBandData(measurements, fit, layout, weighing)
        self.validation = TwoBandData(measurements, held_out, layout, weighing) if held_out else None
        bare = Layout(layout.joints)
        self._start = start_values(measurements, self.two_band.with_layout(bare).narrow)
        self._plain: tuple[Signals, Start] | None = None
        self._plain_shared: dict[object, Any] = {}

    @property
    def rough_compliance(self) -> Array:
        """1/K of the set's rough stiffness, or of a guess, shape (n,)."""
        return self._start.x[self._start.prior.layout.compliance]

    def with_model_error(self, variance: Array) -> FitContext:
        """The same data with a white model error, shape (n,) [Nm²], beside the measurement noise."""
        other = copy(self)
        other.two_band = self.two_band.with_model_error(variance)
        if self.validation is not None:
            other.validation = self.validation.with_model_error(variance)
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
        two_band = self.two_band.with_layout(layout)
        whitening = TrackingWhitening(two_band, _noise_of(near))
        prior, bounds = self.prior_and_bounds(layout)

        def run(x: Array, damped: bool) -> Solved:
            return solve(
                whitening, prior, bounds, x,
                iterations=iterations, negligible=NEGLIGIBLE, least=1, damped=damped, check=check,
            )  # fmt: skip

        solved = run(x, damped=False)
        if solved.end.objective > solved.best.objective + WORSE and iterations:
            # the steps led far uphill from where they had been
            again = run(solved.best.x, damped=True)
            if again.end.objective < solved.end.objective:
                solved = again
        return self._judged(layout, solved.end, solved.converged, near, whitening.noise_at)

    def _judged(
        self, layout: Layout, point: Point, converged: bool, near: Fit | None, noise_at: Array
    ) -> Fit:
        x, total, noise = point.x, point.objective, point.noise_objective
        held_out, chi_held_out, noise_there = None, np.full(layout.n, np.nan), noise_at
        samples = np.count_nonzero(point.used)
        if self.validation is not None:
            two_band = self.validation.with_layout(layout)
            # nothing is fitted to what is held out: its score is not needed
            whitening = TrackingWhitening(two_band, _noise_of(near, held_out=True), with_bias=False)
            held_out = whitening.point(x)
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


def _noise_of(near: Fit | None, held_out: bool = False) -> tuple[list[Whitener], Array] | None:
    """Whiteners of a fit, with the noise shape that they were made for."""
    point = None if near is None else near.held_out if held_out else near.point
    return None if near is None or point is None else (point.whiteners, near.noise_at[held_out])
