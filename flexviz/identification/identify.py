"""Identification of a flexible-joint robot from motor-side data, end to end."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.equation import Equation, Evaluation, Layout, build_signals, layout_of
from flexviz.errors import InputError, choose_from
from flexviz.estimation import (
    Refined,
    Solution,
    Start,
    Stopped,
    TwoBandData,
    base_parameters,
    covariance,
    gauss_newton,
    residual_noise,
    score_covariance,
    start_values,
)
from flexviz.estimation import refine as refine_fit
from flexviz.identification.initial_guess import needs_search, searched_start
from flexviz.identification.result import Identification, ResidualSeries, ResidualSummary
from flexviz.identification.summary import combinations, condition_number, parameter_estimates
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import ButterworthZeroPhase, Observer, make_observer
from flexviz.progress import Iteration, Progress, ProgressCallback, StopCallback

Array = NDArray[np.float64]

BAND_HERTZ = (4.0, 5.0, 6.0, 7.0, 8.5, 10.0)
STIFFNESS_FACTORS = (0.1, 10.0)  # further starts when the first fails


class _Reporter:
    """Numbers the solver's steps, keeps them, and stops the solver when asked to."""

    def __init__(
        self,
        layout: Layout,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.layout, self.progress, self.should_stop = layout, progress, should_stop
        self.names = tuple(layout.labels())
        self.iterations: list[Iteration] = []
        self.stage = ""
        self.stopped = False

    def check(self) -> None:
        if self.should_stop is not None and self.should_stop():
            self.stopped = True
            raise Stopped

    def __call__(self, x: Array, cost: float, step: float) -> None:
        values = x.copy()
        values[self.layout.compliance] = 1 / x[self.layout.compliance]
        iteration = Iteration(len(self.iterations), self.stage, cost, step, values, self.names)
        self.iterations.append(iteration)
        if self.progress is not None:
            self.progress(Progress(self.stage, iteration=iteration))
        self.check()


def identify(
    measurements: MeasurementSet,
    *,
    groups: Sequence[str] | None = None,
    effects: Iterable[str] = (),
    observer: str = ButterworthZeroPhase.name,
    bandwidth: float | Sequence[float] | None = None,
    refine: bool = False,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    max_iterations: int = 60,
) -> Identification:
    """Estimate stiffness, motor inertia, friction, inertial parameters and effects.

    Args:
        measurements: the set.
        groups: names of the groups to fit; all but the validation groups where None.
        effects: "name" (every joint), "name:joint", "name:payload" or "name:joint@group", beside those the
            set's model starts with.
        observer: one of `OBSERVERS`.
        bandwidth: [rad/s], one number or one a joint. None: the zero-phase Butterworth's is chosen by the
            data (least residual), the others have a fixed default.
        refine: run the two_band stage, which removes the observer's bias.
        progress: called after each step.
        should_stop: asked after each step; what was found so far is returned.
        max_iterations: of each solver run.

    Raises:
        InputError: unknown names, or nothing left to fit.
    """
    with threadpool_limits(1, "blas"):  # the matrices are small: threads would only wait for each other
        return _identify(
            measurements,
            groups,
            tuple(effects),
            observer,
            bandwidth,
            refine,
            progress,
            should_stop,
            max_iterations,
        )


def _identify(
    measurements: MeasurementSet,
    groups: Sequence[str] | None,
    effects: tuple[str, ...],
    observer: str,
    bandwidth: float | Sequence[float] | None,
    refine: bool,
    progress: ProgressCallback | None,
    should_stop: StopCallback | None,
    max_iterations: int,
) -> Identification:
    began = time.perf_counter()
    fitted = _fit_groups(measurements, groups)
    layout = _layout(measurements, fitted, effects)
    report = _Reporter(layout, progress, should_stop)
    chosen, equation, start, solution = _plain_fit(
        measurements, fitted, layout, observer, bandwidth, report, max_iterations
    )
    x, at_bound = solution.x, solution.at_bound
    converged = solution.converged
    message = "converged" if converged else "did not converge; the values are where the solver stopped"
    evaluation = solution.evaluation
    cov, share = _plain_covariance(equation, start, solution)
    refined = False
    if refine and not report.stopped:
        report.stage = "refine"
        try:
            report.check()
            result = _refine(measurements, fitted, layout, start, x, report)
            refined = True
            x, at_bound, cov, share = result.x, result.at_bound, result.covariance, result.prior_share
            converged = converged and result.converged
            message = (
                f"refined; whitened residual {result.chi_square:.3g} per sample (1 = measurement noise alone)"
                if result.converged
                else "the two_band did not converge; the values are where it stopped"
            )
        except Stopped:
            pass
        evaluation = equation.at(x, solution.point).evaluate(x)
    if report.stopped:
        converged, message = False, "stopped; the values are those of the last step"

    base = base_parameters(measurements.robot)
    weighted = (evaluation.jacobian * solution.weights[:, :, None]).reshape(-1, layout.size)
    validation = tuple(g for g in measurements.groups if g.validation and g not in fitted)
    summary, series = _residuals(measurements, validation, layout, chosen, equation, evaluation, x)
    estimates = parameter_estimates(layout, x, start.x, cov, share, at_bound, start.prior)
    if (
        not refined
        and not chosen.zero_phase
        and np.any(np.array(summary.rms) > 3 * np.array(summary.noise_floor))
    ):
        # what a lagging observer does to the equation is not in any interval
        estimates = tuple(
            replace(p, identifiable="weak") if p.identifiable == "yes" else p for p in estimates
        )
        message += "; the residual is far above the noise: this observer's own error is not in the intervals"
    return Identification(
        set_name=measurements.name,
        observer_name=chosen.name,
        bandwidth=chosen.bandwidth,
        refined=refined,
        groups=tuple(g.name for g in fitted),
        validation_groups=tuple(g.name for g in validation),
        converged=converged,
        stopped=report.stopped,
        iterations=tuple(report.iterations),
        seconds=time.perf_counter() - began,
        parameters=estimates,
        combinations=combinations(base, layout, x, cov, start.prior),
        residual=summary,
        model=layout.model(x),
        condition_number=condition_number(weighted, layout, base, at_bound),
        covariance=cov,
        parameter_names=report.names,
        residuals=series,
        message=message,
    )


def _layout(measurements: MeasurementSet, fitted: Sequence[Group], effects: Sequence[str]) -> Layout:
    """The model's; an episode has to lie in a group that is fitted."""
    layout = layout_of(measurements, effects)
    names = [g.name for g in fitted]
    for effect in layout.effects:
        if effect.group is not None and effect.group not in names:
            text = effect.text(layout.joints)
            raise InputError(f'effect "{text}": group "{effect.group}" is not fitted; {", ".join(names)} are')
    return layout


def _fit_groups(measurements: MeasurementSet, names: Sequence[str] | None) -> tuple[Group, ...]:
    if names is None:
        fitted = tuple(g for g in measurements.groups if not g.validation)
        if not fitted:
            raise InputError(f"set {measurements.name}: every group is for validation, none is left to fit")
        return fitted
    known = {g.name: g for g in measurements.groups}
    for name in names:
        if name not in known:
            raise InputError(f'group "{name}" is not in the set; {choose_from(name, known)}')
    if not names:
        raise InputError("no group was chosen to fit; name at least one")
    return tuple(known[name] for name in dict.fromkeys(names))


def _plain_fit(
    measurements: MeasurementSet,
    groups: tuple[Group, ...],
    layout: Layout,
    name: str,
    bandwidth: float | Sequence[float] | None,
    report: _Reporter,
    max_iterations: int,
) -> tuple[Observer, Equation, Start, Solution]:
    """The weighted least-squares fit of one band; which band, the data say where nobody else does."""

    def attempt(observer: Observer, near: Array | None = None) -> tuple[Observer, Equation, Start, Solution]:
        equation = Equation(measurements.robot, build_signals(measurements, groups, observer), layout)
        start = start_values(measurements, equation)
        report.stage = f"fit at {float(np.min(observer.bandwidth)):.3g} rad/s"
        if near is None and needs_search(layout):
            near = start.bounds.clip(searched_start(measurements, equation))
        options = {"report": report, "max_iterations": max_iterations}
        begin = start.x if near is None else near
        solution = gauss_newton(equation, start.prior, start.bounds, begin, after=start.point, **options)
        point = solution.point
        for factor in STIFFNESS_FACTORS:
            if solution.converged or report.stopped:
                break
            x = start.x.copy()
            if near is not None:
                x[layout.effect_start :] = near[layout.effect_start :]
            x[layout.compliance] /= factor
            report.stage = f"fit from {factor:g} times the stiffness"
            other = gauss_newton(equation, start.prior, start.bounds, x, after=point, **options)
            point = other.point
            if other.converged or other.evaluation.residual.var() < solution.evaluation.residual.var():
                solution = other
        return observer, equation, start, solution

    if name != ButterworthZeroPhase.name or bandwidth is not None:
        return attempt(make_observer(name, bandwidth))
    best, least = None, np.inf
    for hertz in BAND_HERTZ:
        try:
            # the neighbouring band's result is a better start than the rigid fit
            near = best[3].x if best is not None and best[3].converged else None
            trial = attempt(ButterworthZeroPhase(2 * np.pi * hertz), near)
        except InputError:
            if hertz == BAND_HERTZ[-1] and best is None:
                raise
            continue  # the records are too short for so narrow a band
        size = float(np.log(np.mean(trial[3].evaluation.residual ** 2, axis=0) + 1e-300).sum())
        if best is None or size < least:
            best, least = trial, size
        elif size > least:
            break  # above this, noise only grows
        if report.stopped:
            break
    assert best is not None
    return best


def _plain_covariance(equation: Equation, start: Start, solution: Solution) -> tuple[Array, Array]:
    """Sandwich covariance and prior share; parameters at a bound have none."""
    layout, weights = equation.layout, solution.weights
    jacobian = solution.evaluation.jacobian * weights[:, :, None]
    residual = solution.evaluation.residual * weights
    rows = [b.rows for b in equation.signals.blocks]
    flat = jacobian.reshape(-1, layout.size)
    information = flat.T @ flat
    prior = start.prior.gradient_and_hessian(solution.x)[1]
    cov, share = np.zeros_like(information), np.ones(layout.size)
    free = ~solution.at_bound
    index = np.ix_(free, free)
    colour = score_covariance(residual, jacobian[:, :, free], rows)
    cov[index], share[free] = covariance(information[index], colour, prior[index])
    return cov, share


def _refine(
    measurements: MeasurementSet,
    groups: tuple[Group, ...],
    layout: Layout,
    start: Start,
    x: Array,
    report: _Reporter,
) -> Refined:
    return refine_fit(TwoBandData(measurements, groups, layout), start.prior, start.bounds, x, report=report)


def _residuals(
    measurements: MeasurementSet,
    validation: tuple[Group, ...],
    layout: Layout,
    observer: Observer,
    equation: Equation,
    evaluation: Evaluation,
    x: Array,
) -> tuple[ResidualSummary, dict[str, ResidualSeries]]:
    noise = segments_noise([b.segment for b in equation.signals.blocks])
    floor = np.sqrt(residual_noise(equation.signals, layout, x, evaluation.link, noise))
    series = _series(equation, evaluation)
    rms_validation = None
    if validation:
        held_out = Equation(measurements.robot, build_signals(measurements, validation, observer), layout)
        result = held_out.evaluate(x)
        series |= _series(held_out, result)
        rms_validation = _rms(result.residual)
    return ResidualSummary(
        layout.joints, _rms(evaluation.residual), rms_validation, tuple(map(float, floor))
    ), series


def _rms(residual: Array) -> tuple[float, ...]:
    return tuple(map(float, np.sqrt(np.mean(residual**2, axis=0))))


def _series(equation: Equation, evaluation: Evaluation) -> dict[str, ResidualSeries]:
    out = {}
    signals = equation.signals
    for index, group in enumerate(signals.groups):
        parts = [b.rows for b in signals.blocks if b.group == index]
        if not parts:
            continue
        rows = np.concatenate([np.arange(p.start, p.stop) for p in parts])
        out[group.name] = ResidualSeries(
            signals.time[rows], evaluation.residual[rows], evaluation.torque[0][rows], evaluation.q[0][rows]
        )
    return out
