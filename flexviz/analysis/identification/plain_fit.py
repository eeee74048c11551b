"""Weighted least squares in one band, given or chosen by the residual."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from flexviz.analysis.estimation import (
    ESTIMATION,
    Covariance,
    FittedModel,
    Solution,
    Start,
    Stopped,
    gauss_newton,
    residual_noise,
    spectral_covariance,
    start_values,
    with_model_error,
)
from flexviz.analysis.identification.initial_guess import needs_search, searched_start
from flexviz.analysis.identification.settings import FitSettings
from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.base.iteration import Iteration
from flexviz.base.progress import Progress, ProgressCallback, StopCallback
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.equation import Chain, Equation, Layout, build_signals
from flexviz.model.observers import ButterworthZeroPhase, Observer
from flexviz.robot.model import FlexibleModel

BAND_HERTZ = (4.0, 5.0, 6.0, 7.0, 8.5, 10.0)  # bands to choose from, ascending
STIFFNESS_FACTORS = (0.1, 10.0)  # further starts if the first fails


@dataclass
class StepReporter:
    """Records and reports the solver's steps, and stops the solver on request.

    Attributes:
        layout: of the solver's vector.
        progress: called with each step.
        should_stop: asked after each step.
        stage: what the solver is doing.
        interval: time without a step after which `watch` reports the stage [s].
        iterations: the steps so far.
        stopped: the solver was asked to stop.
    """

    layout: Layout
    progress: ProgressCallback | None
    should_stop: StopCallback | None
    stage: str = ""
    interval: float = 0.5
    iterations: list[Iteration] = field(default_factory=list)
    stopped: bool = False

    def __post_init__(self) -> None:
        self.names = tuple(self.layout.labels())
        self._told = time.monotonic()

    def check(self) -> None:
        if self.should_stop is not None and self.should_stop():
            self.stopped = True
            raise Stopped

    def watch(self) -> None:
        """Called as often as possible between two steps: of many joints, one takes seconds."""
        self.check()
        if self.progress is not None and time.monotonic() - self._told >= self.interval:
            self._told = time.monotonic()
            self.progress(Progress(self.stage))

    def __call__(self, x: Array, cost: float, step: float) -> None:
        values = x.copy()
        values[self.layout.compliance] = 1 / x[self.layout.compliance]
        iteration = Iteration(len(self.iterations), self.stage, cost, step, values, self.names)
        self.iterations.append(iteration)
        if self.progress is not None:
            self._told = time.monotonic()
            self.progress(Progress(self.stage, iteration=iteration))
        self.check()


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The fit of one band.

    Attributes:
        observer: which observer, with its bandwidth.
        equation: on its signals.
        start: where the solver began, with prior and bounds.
        solution: where it ended.
        watch: called while intervals are computed; may raise to stop.
    """

    observer: Observer
    equation: Equation
    start: Start
    solution: Solution
    watch: Callable[[], None] = lambda: None

    @property
    def size(self) -> float:
        """Log of the residual's mean square, summed over the joints."""
        return float(
            np.log(self.equation.signals.mean_square(self.solution.evaluation.residual) + 1e-300).sum()
        )

    def stated(self, held: Sequence[Bools]) -> list[tuple[Covariance, Covariance]]:
        """Covariances with parameters held, (P,) each: with what the model lacks, and of chance alone.

        Chance is what the residual's own spectra say; the model lacks something where noise does not explain
        the residual.
        """
        rows = [b.rows for b in self.equation.signals.blocks]
        measured = self.start.prior.measured(self.solution.x)
        hessian, whitened = self.fitted.hessian, self.solution.whitened
        chance = [spectral_covariance(*whitened, rows, hessian, one, measured) for one in held]
        fits = [replace(self.fitted, at_bound=one) for one in held]
        return list(zip(with_model_error(chance, fits, self.excess), chance, strict=True))

    @cached_property
    def excess(self) -> Array:
        """Mean square of each joint's weighted residual above the noise, shape (n,); else 0."""
        solution, signals = self.solution, self.equation.signals
        noise = segments_noise([b.segment for b in signals.blocks])
        link = solution.evaluation.link
        weights = solution.weights.max(axis=0)
        floor = residual_noise(signals, self.equation.layout, solution.x, link, noise) * weights**2
        chi = signals.mean_square(solution.whitened[0])
        return np.where(chi > ESTIMATION.noise_explains * floor, chi - floor, 0.0)

    @cached_property
    def fitted(self) -> FittedModel:
        """The fit, for what its model lacks."""
        solution, layout = self.solution, self.equation.layout
        residual, jacobian = solution.whitened
        x, link = solution.x, solution.evaluation.link
        return FittedModel(
            point=self.equation.at(x, solution.point),
            chain=Chain(x[layout.compliance], x[layout.link_viscous], link),
            weigh=self._weigh,
            residual=residual.ravel(),
            instruments=jacobian.reshape(-1, layout.size),
            hessian=self.start.prior.gradient_and_hessian(x)[1],
            at_bound=solution.at_bound,
        )

    def _weigh(self, columns: Array, block: int) -> Array:
        """Columns of a block, shape (m, n, k), weighted like the residual, shape (m n, k)."""
        self.watch()
        rows = self.equation.signals.blocks[block].rows
        return (columns * self.solution.weights[rows][:, :, None]).reshape(-1, columns.shape[2])


def plain_fit(
    measurements: MeasurementSet,
    groups: tuple[Group, ...],
    settings: FitSettings,
    report: StepReporter,
    model: FlexibleModel | None = None,
) -> PlainFit:
    """Fit with an observer; by default, the bandwidth of the zero-phase Butterworth of least residual.

    With a `model` its values are taken as they are.
    """
    most = settings.max_iterations
    attempt = partial(_attempt, measurements, groups, model=model, report=report, max_iterations=most)
    if not settings.automatic:
        return attempt(settings.make_observer(), None)
    best: PlainFit | None = None
    for hertz in BAND_HERTZ:
        # the neighbouring band's result is a better start than the rigid fit
        near = best.solution.x if best is not None and best.solution.converged else None
        band = ButterworthZeroPhase(2 * np.pi * hertz)
        try:
            trial = attempt(band, near)
        except InputError:
            if hertz == BAND_HERTZ[-1] and best is None:
                raise
            continue  # the records are too short for so narrow a band
        if best is not None and trial.size > best.size:
            break  # above this, noise only grows
        if best is None or trial.size < best.size:
            best = trial
        if report.stopped:
            break
    assert best is not None
    return best


def _attempt(
    measurements: MeasurementSet,
    groups: tuple[Group, ...],
    observer: Observer,
    near: Array | None,
    *,
    model: FlexibleModel | None,
    report: StepReporter,
    max_iterations: int,
) -> PlainFit:
    """Fit from the start values or from `near`; if that fails, from other stiffnesses.

    The values of a `model` are taken without a step of the solver.
    """
    layout = report.layout
    equation = Equation(measurements.robot, build_signals(measurements, groups, observer), layout)
    start = start_values(measurements, equation)
    prior, bounds = start.prior, start.bounds
    if model is not None:
        end = gauss_newton(equation, prior, bounds, bounds.clip(layout.vector(model)), max_iterations=0)
        return PlainFit(observer, equation, start, replace(end, converged=True))
    report.stage = f"fit at {float(np.min(observer.bandwidth)):.3g} rad/s"
    if near is None and needs_search(layout):
        near = bounds.clip(searched_start(measurements, equation))
    x = start.x if near is None else bounds.clip(near)
    descend = partial(
        gauss_newton,
        equation,
        prior,
        bounds,
        report=report,
        watch=report.watch,
        max_iterations=max_iterations,
    )
    solution = last = descend(x, after=start.point)
    for factor in STIFFNESS_FACTORS:
        if solution.converged or report.stopped:
            break
        x = start.x.copy()
        if near is not None:
            x[layout.effect_start :] = near[layout.effect_start :]
        x[layout.compliance] /= factor
        report.stage = f"fit from {factor:g} times the stiffness"
        last = descend(x, after=last.point)
        if last.converged or last.evaluation.residual.var() < solution.evaluation.residual.var():
            solution = last
    return PlainFit(observer, equation, start, solution, report.watch)
