"""Fits of one model to all data, in units of the measurement noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Equation, Layout, Signals, build_signals
from flexviz.equation.residual import Chain
from flexviz.identification.prior import Prior
from flexviz.identification.refine import Point, feasible_step, whitened_point
from flexviz.identification.refinement import Refinement
from flexviz.identification.solver import Bounds, bounded_step, gauss_newton
from flexviz.identification.start import start_values
from flexviz.measurements import MeasurementSet
from flexviz.observers import ButterworthZeroPhase

Array = NDArray[np.float64]

PLAIN_HERTZ = 7.0
STIFFNESS_REACH = 20.0  # a stiffness is sought within this factor of its rough value
NEGLIGIBLE = 0.05  # [standard deviations] a step that ends a fit


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
        converged: the last step was negligible.
    """

    layout: Layout
    x: Array
    point: Point
    held_out: Point | None
    chi: Array
    chi_held_out: Array
    objective: float
    converged: bool


class Workbench:
    """The data of one diagnosis, shared by every model that is tried."""

    def __init__(self, measurements: MeasurementSet, layout: Layout) -> None:
        self.measurements = measurements
        fit = [g for g in measurements.groups if not g.validation]
        held_out = [g for g in measurements.groups if g.validation]
        self.fit_groups, self.held_out_groups = fit, held_out
        self.refinement = Refinement(measurements, fit, layout)
        self._plain: Signals | None = None
        self.validation = Refinement(measurements, held_out, layout) if held_out else None

    def assumptions(self, layout: Layout) -> tuple[Prior, Bounds]:
        """Prior and bounds of a layout; viscous friction may be negative while something is still missing."""
        refinement = self.refinement.with_layout(layout)
        start = start_values(self.measurements, refinement.narrow)
        lower = start.bounds.lower.copy()
        lower[layout.link_viscous] = lower[layout.motor_viscous] = -np.inf
        # a wrong model may want a rigid joint; the next one has to find its way back
        upper = start.bounds.upper.copy()
        rough = start.x[layout.compliance]
        lower[layout.compliance], upper[layout.compliance] = rough / STIFFNESS_REACH, rough * STIFFNESS_REACH
        return start.prior, replace(start.bounds, lower=lower, upper=upper)

    def fit(
        self,
        layout: Layout,
        x: Array,
        *,
        iterations: int = 10,
        check: Callable[[], None] = lambda: None,
    ) -> Fit:
        """Gauss–Newton on Zᵀ W r = 0 from x.

        Args:
            layout: the model's effects.
            x: start, shape (P,).
            iterations: at most this many steps.
            check: called before each step; may raise to stop.
        """
        refinement = self.refinement.with_layout(layout)
        prior, bounds = self.assumptions(layout)
        x = bounds.clip(x)
        whiteners = None
        point, converged = None, False
        best: tuple[float, Array, Point] | None = None
        for iteration in range(iterations + 1):
            check()
            point = whitened_point(refinement, x, whiteners)
            if iteration >= 1:
                whiteners = point.whiteners
            size = _objective(point, layout)
            if best is None or size < best[0]:
                best = size, x, point
            gradient, prior_hessian = prior.gradient_and_hessian(x)
            flat = point.z.reshape(-1, layout.size)
            hessian = flat.T @ flat + prior_hessian
            step, _ = bounded_step(gradient + flat.T @ point.r.ravel(), hessian, x, bounds)
            length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
            converged = length < NEGLIGIBLE and iteration >= 2
            if converged or iteration == iterations:
                break
            x = feasible_step(prior, bounds, x, step)
        assert best is not None and point is not None
        if not converged:
            x, point = best[1], best[2]
        return self._judged(layout, x, point, converged)

    def _judged(self, layout: Layout, x: Array, point: Point, converged: bool) -> Fit:
        total = _objective(point, layout)
        held_out, chi_held_out = None, np.full(layout.n, np.nan)
        samples = np.count_nonzero(point.used)
        if self.validation is not None:
            held_out = whitened_point(self.validation.with_layout(layout), x)
            chi_held_out = _chi(held_out)
            total += _objective(held_out, layout)
            samples += np.count_nonzero(held_out.used)
        freedom = layout.size - layout.effect_start
        total += freedom * float(np.log(samples * layout.n))
        return Fit(layout, x, point, held_out, _chi(point), chi_held_out, total, converged)

    def roughly(self, layout: Layout, x: Array, check: Callable[[], None] = lambda: None) -> Array:
        """A plain fit of a layout: weighted by its own residual, it finds its way from far off.

        Args:
            layout: the model's effects.
            x: the effects' values to start from; everything else starts from the rigid fit, because another
                model's stiffness may be anywhere.
        """
        if self._plain is None:
            observer = ButterworthZeroPhase(2 * np.pi * PLAIN_HERTZ)
            self._plain = build_signals(self.measurements, self.fit_groups, observer)
        equation = Equation(self.measurements.robot, self._plain, layout)
        start = start_values(self.measurements, equation)
        begin = start.x.copy()
        begin[layout.effect_start :] = x[layout.effect_start :]
        _, bounds = self.assumptions(layout)
        equation = Equation(self.measurements.robot, self._plain, layout)
        solution = gauss_newton(
            equation, start.prior, bounds, bounds.clip(begin), reweightings=2, max_iterations=14,
            report=lambda *_: check(),
        )  # fmt: skip
        return solution.x

    def chain(self, fit: Fit) -> Chain:
        """How changes of s and q move the residual at a fit."""
        lay = fit.layout
        return Chain(fit.x[lay.compliance], fit.x[lay.link_viscous], fit.point.narrow.link)


def _chi(point: Point) -> Array:
    return np.sum(point.r**2, axis=0) / np.count_nonzero(point.used)


def _objective(point: Point, layout: Layout) -> float:
    samples = np.count_nonzero(point.used)
    noise = samples * float(np.log(np.maximum(_chi(point), 1.0)).sum())
    return noise + sum(m.log_determinant for m in point.metrics)
