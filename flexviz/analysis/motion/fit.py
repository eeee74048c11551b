"""Fits in the band of the motion, weighted by what the model leaves.

Where many effects are missing the model errs more than the sensors, and weights from the sensors' noise are
misleading. Here every joint is weighted by its own residual, large residuals count linearly (Huber), and
priors are firm (`firm_start`), so that a quantity that the data do not show stays where it was given.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.estimation import (
    Covariance,
    Descent,
    FittedModel,
    NormalEquations,
    Prior,
    Projection,
    Reach,
    Start,
    residual_noise,
    spectral_covariance,
    start_values,
    with_model_error,
)
from flexviz.analysis.motion.robust import robust_weights
from flexviz.analysis.motion.samples import Phase, Phases, motion_signals, phases
from flexviz.analysis.motion.start import firm_start
from flexviz.analysis.motion.thresholds import MOTION
from flexviz.analysis.motion.unknown import has_gaps, unknown_variance
from flexviz.base.errors import InputError
from flexviz.base.recent import Recent
from flexviz.data.measurements import MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.equation import (
    Chain,
    Equation,
    Layout,
    LinkTerms,
    OperatingPoint,
    layout_of,
)

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

STEPS = 20  # of a fit at most
STARTS = 8  # of models that are kept
SETTLED = 0.5  # change of the objective that ends a fit


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
        ended: `watch` has ended the fit.
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
    ended: bool = False
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
        jacobian = (
            self.point.evaluate(self.x, moving=True, near=True).jacobian if jacobian is None else jacobian
        )
        jacobian *= self.weights[:, :, None]
        return jacobian

    def weigh(self, columns: Array, block: int) -> Array:
        """Columns of a stretch, shape (m, n, k), weighted like the residual, shape (m n, k)."""
        rows = self.context.signals.blocks[block].rows
        return (columns * self.weights[rows][:, :, None]).reshape(-1, columns.shape[2])

    @property
    def velocity(self) -> Array:
        """Of the motors in the fit groups, shape (N, n) [rad/s]."""
        return self.context.signals.theta[1]

    @property
    def position(self) -> Array:
        """Of the motors in the fit groups, shape (N, n) [rad]."""
        return self.context.signals.theta[0]

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

    def covariances(self, at_bound: Bools) -> tuple[Covariance, Covariance]:
        """Of the parameters with some at a bound, (P,): with what the model lacks, and of chance alone.

        Chance is what the residual's own spectra say.
        """
        held, chance = self._held(at_bound), self.chance(at_bound)
        (stated,) = with_model_error([chance], [self.fitted_model(held)], self.excess)
        return stated, chance

    @property
    def excess(self) -> Array:
        """Mean square of each joint's weighted residual above that of the noise, shape (n,)."""
        floor = np.mean((self.context.noise_floor * self.weights) ** 2, axis=0)
        return np.maximum(np.mean(self.whitened[0] ** 2, axis=0) - floor, 0.0)

    def fitted_model(self, held: Bools) -> FittedModel:
        """What the fit knows of model and data, with some parameters held, (P,)."""
        whitened, jacobian = self.whitened
        flat, hessian = jacobian.reshape(-1, self.layout.size), self.prior_derivatives[1]
        return FittedModel(self.point, self.chain, self.weigh, whitened.ravel(), flat, hessian, held)

    def chance(self, at_bound: Bools) -> Covariance:
        """Of the parameters with some at a bound, (P,), by the residual's own spectra."""
        rows = [b.rows for b in self.context.signals.blocks]
        measured = self.context.start(self.layout).prior.measured(self.x)
        hessian = self.prior_derivatives[1]
        return spectral_covariance(*self.whitened, rows, hessian, self._held(at_bound), measured)

    def _held(self, at_bound: Bools) -> Bools:
        return at_bound & (np.arange(len(self.x)) >= self.layout.effect_start)

    @property
    def held(self) -> NDArray[np.bool_]:
        """Parameters at a bound that count as certain: those of effects, not the robot's own, shape (P,)."""
        return self.at_bound & (np.arange(len(self.x)) >= self.layout.effect_start)

    def _held_out(self) -> list[OperatingPoint]:
        parts = range(1, len(self.context.parts))
        return [self.context.equation(self.layout, part).at(self.x) for part in parts]

    @cached_property
    def judged(self) -> tuple[list[Array], list[Array | None]]:
        """Residuals and what the model does not know, of each of the context's parts.

        Shape (N, n): residual [Nm], variance of the torque that the model does not know [Nm²]; None: zero.
        """
        points = [self.point, *self._held_out()]
        residuals = [self.residual, *(point.residual(self.x) for point in points[1:])]
        if not has_gaps(self.layout):
            return residuals, [None] * len(points)
        return residuals, [unknown_variance(point, self.x) for point in points]

    @property
    def residuals(self) -> list[Array]:
        """Of each of the context's parts, shape (N, n) [Nm]."""
        return self.judged[0]

    def jacobians(self) -> list[Array]:
        """Of each of the context's parts, shape (N, n, P)."""
        return [
            point.evaluate(self.x, moving=True, near=True).jacobian
            for point in (self.point, *self._held_out())
        ]

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
        parts: signals of the fit groups, `signals`, and of the validation groups if any are long enough.
        first_phase: shape (n,), the first phase of each joint that counts (`set_standstill_apart`).
        stand_ins: free curves only stand for what has no law (`firm_start`).
    """

    def __init__(
        self, measurements: MeasurementSet, joints: tuple[str, ...], stand_ins: bool = False
    ) -> None:
        self.measurements, self.stand_ins = measurements, stand_ins
        self.parts = [motion_signals(measurements, measurements.fit_groups)]
        if measurements.validation_groups:
            with suppress(InputError):  # too short for the band: they are not judged
                self.parts.append(motion_signals(measurements, measurements.validation_groups))
        self.signals = self.parts[0]
        self.first_phase: Phases = np.full(len(joints), Phase.REST, np.int8)
        self._shared = [dict[object, Any]() for _ in self.parts]
        model = layout_of(measurements).with_effects()
        self._fitted = model.fitted
        bare = self.equation(model)
        self._start = start_values(measurements, bare)
        self._starts = dict[Layout, Start]()  # of the last models
        rigid = bare.evaluate(self._start.x)
        noise = segments_noise([b.segment for b in self.signals.blocks])
        variance = residual_noise(self.signals, model, self._start.x, rigid.link, noise)
        self.noise_floor: Array = np.sqrt(variance)
        self.spread: Array = np.std(self.signals.tau[0], axis=0)
        # shape (n,), the error that counts: more than noise, and than laws leave that are right [Nm]
        self.least: Array = np.maximum(
            (1 + MOTION.noise_known) * self.noise_floor, MOTION.tolerance * self.spread
        )

    @cached_property
    def phases(self) -> list[Phases]:
        """Of each part, shape (N, n)."""
        return list(map(phases, self.parts))

    @property
    def used(self) -> list[NDArray[np.bool_]]:
        """Samples of each part that count, shape (N, n)."""
        pairs = zip(self.phases, self.parts, strict=True)
        return [(phase >= self.first_phase) & self._fitted & part.known for phase, part in pairs]

    def equation(self, layout: Layout, part: int = 0) -> Equation:
        """Equation of one of the parts."""
        return Equation(self.measurements.robot, self.parts[part], layout, self._shared[part])

    def set_standstill_apart(self, fit: MotionFit) -> bool:
        """From now on leave out the standstill of joints where a fit errs much more at rest than in motion.

        Returns whether there are more than before. At rest friction takes any value up to its limit, brakes
        hold, and controllers drift: no law of the motion describes the torque there.
        """
        before, moving, used = self.first_phase, self.phases[0] == Phase.MOTION, self.used[0]
        rest, motion = (
            np.sum(fit.residual**2 * part, axis=0) / np.maximum(part.sum(axis=0), 1)
            for part in (~moving & used, moving)
        )
        ratio, share = MOTION.louder, MOTION.tolerance
        louder = rest > np.maximum(ratio**2 * motion, (share * self.spread) ** 2)
        self.first_phase = np.where(louder, np.int8(Phase.MOTION), before)
        return bool(np.any(self.first_phase > before))

    def start(self, layout: Layout) -> Start:
        """Start values with firm priors: CAD inertias, rough stiffness and motor inertia, drive gains."""
        if layout not in self._starts:
            made = firm_start(self.measurements, self.signals, self._start, layout, self.stand_ins)
            self._starts = {**dict([*self._starts.items()][-STARTS:]), layout: made}
        return self._starts[layout]

    def fit(
        self,
        layout: Layout,
        x: Array,
        *,
        iterations: int = STEPS,
        check: Callable[[], None] = lambda: None,
        settled: float = SETTLED,
        watch: Callable[[Descent[MotionFit]], bool] = lambda descent: False,
    ) -> MotionFit:
        """Gauss–Newton from x, shape (P,), with weights from the residual, renewed at every step.

        `check` is called before each step and may raise to stop; `settled`: change of the objective that
        ends the fit; `watch` may end it at any place.
        """
        start = self.start(layout)
        problem = MotionProblem(self, self.equation(layout), start.prior, check)
        reach = Reach(start.bounds, start.prior.feasible, layout.compliance)
        place = problem.at(start.bounds.clip(x))
        descent = Descent(problem, reach, place, settled=settled, damped=True, watch=watch)
        descent.run(iterations)
        found = replace(descent.place, ended=descent.ended) if descent.ended else descent.place
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
        now = point.evaluate(x, moving=True, near=True)
        weights, misfit = robust_weights(now.residual, context.least, context.used[0])
        fit = MotionFit(
            context, point.layout, x, point, now.residual, now.torque[0].copy(), now.link, weights,
            np.zeros(len(x), bool), misfit + 2 * self.prior.value(x),
        )  # fmt: skip
        fit._jacobian.get(lambda: fit._weighted(now.jacobian))
        return fit

    def lower(self, x: Array, before: MotionFit) -> MotionFit | None:
        """The same if the objective is lower at the operating point of another."""
        context = self.context
        misfit = robust_weights(before.point.residual(x), context.least, context.used[0])[1]
        return self.at(x, before) if misfit + 2 * self.prior.value(x) < before.objective else None

    def normal_equations(self, place: MotionFit) -> NormalEquations:
        """Of half the objective."""
        gradient, hessian = place.prior_derivatives
        slope = place.instruments().T @ place.whitened[0].ravel()
        return NormalEquations(gradient + slope, place.information, hessian)
