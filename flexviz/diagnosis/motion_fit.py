"""Fits in the band of the motion, weighted by what the model leaves.

Where many effects are missing the model errs more than the sensors, and weights from the sensors' noise are
misleading. Here every joint is weighted by its own residual, large residuals count linearly (Huber), and
priors are firm (`firm_start`), so that a quantity that the data do not show stays where it was given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.firm_start import firm_start
from flexviz.diagnosis.motion_samples import Phase, Phases, phases, robust_weights
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Chain, Equation, Layout, LinkTerms, OperatingPoint, Signals, build_signals
from flexviz.estimation import (
    Covariance,
    Descent,
    NormalEquations,
    Prior,
    Projection,
    Reach,
    Start,
    residual_noise,
    spectral_covariance,
    start_values,
)
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import ButterworthZeroPhase
from flexviz.recent import Recent

Array = NDArray[np.float64]

HERTZ, SAMPLES = 7.0, 4  # band of the motion, and samples of a cycle at its edge
MAX_ITERATIONS = 25
SETTLED = 0.5  # change of the objective that ends a fit
LONGEST_EDGE = 0.1  # share of a stretch that is dropped at each of its ends at most
NEAR = 8.0  # times the noise, below which rest and motion are not told apart


@dataclass(frozen=True, eq=False)
class MotionFit:
    """A model fitted to the fit groups, with its residuals on all groups.

    Attributes:
        context: the data.
        layout, x: the model and its parameters, shape (P,).
        point: operating point of the effects in the fit groups.
        residual: of the fit groups, shape (N, n) [Nm].
        torque: transmission torque of the fit groups, shape (N, n) [Nm].
        link: rigid-body terms of the fit groups.
        weights: shape (N, n), 1/σ of each sample and joint, less for outliers [1/Nm].
        at_bound: shape (P,), parameters held at a bound.
        objective: twice the negative log likelihood of residuals of unknown variance, and the prior.
    """

    context: MotionContext
    layout: Layout
    x: Array
    point: OperatingPoint
    residual: Array
    torque: Array
    link: LinkTerms
    weights: Array
    at_bound: NDArray[np.bool_]
    objective: float
    _jacobian: Recent[Array] = field(default_factory=partial(Recent, "weighted", 3), init=False)

    @cached_property
    def prior_derivatives(self) -> tuple[Array, Array]:
        """Gradient (P,) and Hessian (P, P) of the prior."""
        return self.context.start(self.layout).prior.gradient_and_hessian(self.x)

    @property
    def whitened(self) -> tuple[Array, Array]:
        """Weighted residual (N, n) and Jacobian (N, n, P)."""
        return self.residual * self.weights, self._jacobian.get(self._weighted)

    def _weighted(self, jacobian: Array | None = None) -> Array:
        jacobian = self.point.evaluate(self.x, moving=True).jacobian if jacobian is None else jacobian
        jacobian *= self.weights[:, :, None]
        return jacobian

    @property
    def velocity(self) -> Array:
        """Of the motors in the fit groups, shape (N, n) [rad/s]."""
        return self.context.signals.theta[1]

    def instruments(self) -> Array:
        """The weighted Jacobian Z, shape (N n, P)."""
        return self.whitened[1].reshape(-1, self.layout.size)

    @cached_property
    def information(self) -> Array:
        """Zᵀ Z, shape (P, P)."""
        flat = self.instruments()
        return flat.T @ flat

    @cached_property
    def projection(self) -> Projection:
        """Projection of weighted signatures onto the complement of the model's own parameters."""
        gradient, hessian = self.prior_derivatives
        return Projection(self.whitened[0].ravel(), self.instruments, self.information + hessian, gradient)

    @cached_property
    def covariance(self) -> Covariance:
        """Of the parameters, from the residual's own spectra."""
        rows = [b.rows for b in self.context.signals.blocks]
        return spectral_covariance(*self.whitened, rows, self.prior_derivatives[1], self.held)

    @property
    def held(self) -> NDArray[np.bool_]:
        """Parameters at a bound that count as certain: those of effects, not the robot's own, shape (P,)."""
        return self.at_bound & (np.arange(len(self.x)) >= self.layout.effect_start)

    @property
    def held_out(self) -> bool:
        """Whether there are validation groups."""
        return self.context.judged_signals is not self.context.signals

    @cached_property
    def held_out_residual(self) -> Array:
        """Residual of the validation groups, shape (N, n) [Nm]."""
        return self.context.equation(self.layout, held_out=True).at(self.x).residual(self.x)

    def held_out_jacobian(self) -> Array:
        """Jacobian of the validation groups, shape (N, n, P); zero where a sample does not count."""
        point = self.context.equation(self.layout, held_out=True).at(self.x)
        return point.evaluate(self.x, moving=True).jacobian * self.context.judged_used[:, :, None]

    def towards(self, x: Array, smaller: Layout) -> Array:
        """Start of a smaller model on the way to x, shape (P,): a linear move may leave what is possible."""
        prior = self.context.start(smaller).prior
        for share in (1.0, 0.5, 0.25):
            start = smaller.vector(self.layout.model(self.x + share * (x - self.x)))
            if prior.feasible(start):
                return start
        return smaller.vector(self.layout.model(self.x))

    @property
    def chain(self) -> Chain:
        """Sensitivity of the residual to s and q."""
        return Chain(self.x[self.layout.compliance], self.x[self.layout.link_viscous], self.link)


class MotionContext:
    """Signals of a set in the band of the motion, shared by all models.

    Attributes:
        measurements: the set.
        signals: of the fit groups.
        judged_signals: of the validation groups, or of the fit groups where there are none.
        first_phase: shape (n,), the first phase of each joint that counts (`set_standstill_apart`).
        stand_ins: free curves only stand for what has no law (`firm_start`).
    """

    def __init__(
        self, measurements: MeasurementSet, joints: tuple[str, ...], stand_ins: bool = False
    ) -> None:
        self.measurements, self.stand_ins = measurements, stand_ins
        held = measurements.validation_groups
        self.signals = self._signals(measurements.fit_groups)
        self.judged_signals = self._signals(held) if held else self.signals
        self.first_phase: Phases = np.full(len(joints), Phase.REST, np.int8)
        self._shared = dict[object, Any](), dict[object, Any]()  # of both
        bare = self.equation(Layout(joints))
        self._start = start_values(measurements, bare)
        rigid = bare.evaluate(self._start.x)
        noise = segments_noise([b.segment for b in self.signals.blocks])
        variance = residual_noise(self.signals, Layout(joints), self._start.x, rigid.link, noise)
        self.noise_floor: Array = np.sqrt(variance)
        self.spread: Array = np.std(self.signals.tau[0], axis=0)

    def _signals(self, groups: tuple[Group, ...]) -> Signals:
        made = build_signals(
            self.measurements, groups, ButterworthZeroPhase(2 * np.pi * HERTZ),
            sample_step=1 / (SAMPLES * HERTZ), exact_step=True, longest_edge=LONGEST_EDGE,
        )  # fmt: skip
        return replace(made, sharp=True)

    @cached_property
    def phases(self) -> Phases:
        """Of the fit groups, shape (N, n)."""
        return phases(self.signals)

    @cached_property
    def judged_phases(self) -> Phases:
        """Of `judged_signals`, shape (N, n)."""
        return phases(self.judged_signals)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Samples of the fit groups that count, shape (N, n)."""
        return self.phases >= self.first_phase

    @property
    def judged_used(self) -> NDArray[np.bool_]:
        """Samples of `judged_signals` that count, shape (N, n)."""
        return self.judged_phases >= self.first_phase

    def equation(self, layout: Layout, held_out: bool = False) -> Equation:
        """Equation of the fit groups, or of the validation groups."""
        signals = self.judged_signals if held_out else self.signals
        return Equation(self.measurements.robot, signals, layout, self._shared[held_out])

    def set_standstill_apart(self, fit: MotionFit) -> bool:
        """From now on leave out the standstill of joints where a fit errs much more at rest than in motion.

        Returns whether there are more than before. At rest friction takes any value up to its limit, brakes
        hold, and controllers drift: no law of the motion describes the torque there.
        """
        before, moving = self.first_phase, self.phases == Phase.MOTION
        rest, motion = (
            np.sum(fit.residual**2 * part, axis=0) / np.maximum(part.sum(axis=0), 1)
            for part in (~moving & self.used, moving)
        )
        louder = (np.sqrt(rest) > NEAR * self.noise_floor) & (
            rest > THRESHOLDS.criterion.deviations**2 * motion
        )
        self.first_phase = np.where(louder, np.int8(Phase.MOTION), before)
        return bool(np.any(self.first_phase > before))

    def start(self, layout: Layout) -> Start:
        """Start values with firm priors: CAD inertias, rough stiffness and motor inertia, drive gains."""
        return firm_start(self.measurements, self.signals, self._start, layout, self.stand_ins)

    def fit(
        self,
        layout: Layout,
        x: Array,
        *,
        iterations: int = MAX_ITERATIONS,
        check: Callable[[], None] = lambda: None,
    ) -> MotionFit:
        """Gauss–Newton with weights from the residual, which are renewed at every step.

        Args:
            layout: the model.
            x: start, shape (P,).
            iterations: maximum number of steps.
            check: called before each step; may raise to stop.
        """
        start = self.start(layout)
        problem = MotionProblem(self, self.equation(layout), start.prior, check)
        reach = Reach(start.bounds, start.prior.feasible, layout.compliance)
        descent = Descent(problem, reach, problem.at(start.bounds.clip(x)), settled=SETTLED, damped=True)
        descent.run(iterations)
        found = descent.place
        found.at_bound[:] = descent.at_bound
        found.point.context.forget()  # a search keeps many fits
        return found


@dataclass(frozen=True)
class MotionProblem:
    """Twice the negative log likelihood of a model in the band of the motion, a `Problem` of `Descent`."""

    context: MotionContext
    equation: Equation
    prior: Prior
    check: Callable[[], None]  # before each fit; may raise to stop

    def at(self, x: Array, before: MotionFit | None = None) -> MotionFit:
        """The model at x, shape (P,), with its weights and objective."""
        self.check()
        context, point = self.context, self.equation.at(x, before and before.point)
        now = point.evaluate(x, moving=True)
        weights, misfit = robust_weights(now.residual, context.noise_floor, context.used)
        fit = MotionFit(
            context, point.layout, x, point, now.residual, now.torque[0].copy(), now.link, weights,
            np.zeros(len(x), bool), misfit + 2 * self.prior.value(x),
        )  # fmt: skip
        fit._jacobian.get(lambda: fit._weighted(now.jacobian))
        return fit

    def lower(self, x: Array, before: MotionFit) -> MotionFit | None:
        """The same if the objective is lower at the operating point of another."""
        context = self.context
        misfit = robust_weights(before.point.residual(x), context.noise_floor, context.used)[1]
        return self.at(x, before) if misfit + 2 * self.prior.value(x) < before.objective else None

    def normal_equations(self, place: MotionFit) -> NormalEquations:
        """Of half the objective."""
        gradient, hessian = place.prior_derivatives
        slope = place.instruments().T @ place.whitened[0].ravel()
        return NormalEquations(gradient + slope, place.information, hessian)
