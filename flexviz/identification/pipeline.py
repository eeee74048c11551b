"""Identification of a flexible-joint robot from motor-side data, end to end."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.arrays import Array, Bools
from flexviz.equation import Equation, Evaluation, Layout, build_signals, layout_of
from flexviz.errors import InputError
from flexviz.estimation import ESTIMATION, Covariance, Stopped, TwoBandData, base_parameters, residual_noise
from flexviz.estimation import refine as refine_fit
from flexviz.identification.failure import (
    Unrest,
    far_above_noise,
    unexplained,
    unrest_by_residual,
    unrest_of,
    why_not,
)
from flexviz.identification.plain_fit import PlainFit, StepReporter, plain_fit
from flexviz.identification.result import Identification, ResidualSeries, ResidualSummary
from flexviz.identification.reversals import rms_between_reversals
from flexviz.identification.summary import combinations, condition_number, parameter_estimates
from flexviz.measurements import Group, MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.noise import check_signals, segments_noise
from flexviz.observers import ButterworthZeroPhase, EsoGains
from flexviz.progress import ProgressCallback, StopCallback
from flexviz.wording import listed, normalised, plural


def identify(
    measurements: MeasurementSet,
    *,
    groups: Sequence[str] | None = None,
    effects: Iterable[str] = (),
    observer: str = ButterworthZeroPhase.name,
    bandwidth: float | Sequence[float] | None = None,
    gains: EsoGains | None = None,
    refine: bool = False,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    max_iterations: int = 60,
    model: FlexibleModel | None = None,
) -> Identification:
    """Estimate stiffness, motor inertia, friction, inertial parameters and effects.

    Args:
        measurements: the set.
        groups: names of the groups to fit; all but the validation groups where None.
        effects: "name" (every joint), "name:joint", "name:payload" or "name:joint@group", beside those the
            set's model starts with.
        observer: one of `OBSERVERS`.
        bandwidth: [rad/s], one number or one per joint. None: the zero-phase Butterworth's is chosen by the
            data (least residual), the others have a fixed default.
        gains: of the observer "eso", set by hand; a bandwidth scales them.
        refine: run the instrumental-variables refinement, which removes the observer's bias.
        progress: called after each step.
        should_stop: asked after each step; what was found so far is returned.
        max_iterations: of each solver run.
        model: values to take instead of fitting them; the result has their errors and residuals.

    Raises:
        InputError: unknown names, a validation group, nothing left to fit, or signals that are no motion
            of a robot.
    """
    began = time.perf_counter()
    fitted, held_out = measurements.select(groups)
    noise = check_signals(measurements, (*fitted, *held_out))
    layout = _layout(measurements, fitted, tuple(effects))
    report = StepReporter(layout, progress, should_stop)
    with threadpool_limits(1, "blas"):  # the matrices are small: threads would only wait for each other
        plain = plain_fit(measurements, fitted, observer, bandwidth, report, max_iterations, model, gains)
        outcome = _plain_outcome(plain)
        if model is not None:
            text = "values as given; they were not fitted with this observer"
            outcome = replace(outcome, message=text, given=True)
        elif refine and not report.stopped:
            outcome = _refined_outcome(measurements, fitted, plain, outcome, report)
        if report.stopped:
            text = "stopped; the values are those of the last step"
            outcome = replace(outcome, converged=False, message=text)
        result = _result(measurements, fitted, plain, outcome, report)
    residual = _with_noise_share(result.residual, noise)
    message = result.message + _left_out(result, (*fitted, *held_out))
    return replace(result, residual=residual, message=message, seconds=time.perf_counter() - began)


def _left_out(result: Identification, groups: Sequence[Group]) -> str:
    """The groups that are not used; empty if all are."""
    used = (*result.groups, *result.validation_groups)
    names = [group.name for group in groups if group.name not in used]
    if not names:
        return ""
    text = (
        f"; {plural(len(names), 'group')} not used: {listed(names)}, gaps leave no stretch longer than the "
    )
    return f"{text}observer's transients"


def _with_noise_share(residual: ResidualSummary, of_torque: Sequence[float]) -> ResidualSummary:
    """The noise of the signals themselves, or that of the equation in its own band if it is larger."""
    floors = normalised(residual.noise_floor, residual.torque_spread)
    return replace(residual, noise_share=tuple(map(max, of_torque, np.nan_to_num(floors).tolist())))


def _layout(measurements: MeasurementSet, fitted: Sequence[Group], effects: Sequence[str]) -> Layout:
    """The model's; an episode has to lie in a group that is fitted."""
    layout = layout_of(measurements, effects)
    names = [g.name for g in fitted]
    for effect in layout.effects:
        if effect.group is not None and effect.group not in names:
            text = effect.text(layout.joints)
            raise InputError(f'effect "{text}": group "{effect.group}" is not fitted; {", ".join(names)} are')
    return layout


@dataclass(frozen=True, eq=False)
class _Outcome:
    """Final state of the fits.

    Attributes:
        x: shape (P,).
        evaluation: the plain fit's equation there.
        covariance: of the parameters.
        at_bound: shape (P,).
        converged, refined, message: as in `Identification`.
        unrest: what keeps the fit from converging.
        given: the values were not fitted.
    """

    x: Array
    evaluation: Evaluation
    covariance: Covariance
    at_bound: Bools
    converged: bool
    message: str
    refined: bool = False
    unrest: Unrest | None = None
    given: bool = False


def _plain_outcome(plain: PlainFit) -> _Outcome:
    end = plain.solution
    message = "converged" if end.converged else "did not converge; the values are where the solver stopped"
    unrest = None if end.converged else unrest_of(end, plain.start, plain.equation.layout)
    covariance = plain.covariance()
    return _Outcome(end.x, end.evaluation, covariance, end.at_bound, end.converged, message, unrest=unrest)


def _refined_outcome(
    measurements: MeasurementSet,
    groups: tuple[Group, ...],
    plain: PlainFit,
    outcome: _Outcome,
    report: StepReporter,
) -> _Outcome:
    """The refinement's result; the plain one where it is stopped."""
    report.stage = "refine"
    start = plain.start
    try:
        report.check()
        two_band = TwoBandData(measurements, groups, report.layout)
        found = refine_fit(two_band, start.prior, start.bounds, outcome.x, report=report)
    except Stopped:
        return outcome
    message = "the instrumental-variables refinement did not converge; the values are where it stopped"
    x, chi, model_error = found.place.x, found.place.chi, found.place.model_error
    chi_square = float(np.mean(chi))
    if found.converged:
        message = f"refined; whitened residual {chi_square:.3g} per sample (1 = measurement noise alone)"
        if model_error.any():
            added = ", ".join(f"{value:.2g}" for value in np.sqrt(model_error))
            message = (
                f"refined; the model errs more than the sensors, a model error ({added} Nm) was allowed for"
            )
    evaluation = plain.equation.at(x, plain.solution.point).evaluate(x)
    converged = outcome.converged and found.converged
    unrest = outcome.unrest if found.converged else unrest_by_residual(chi)
    from_noise = chi_square < ESTIMATION.noise_explains
    covariance = found.place.covariance(start.prior, from_noise, found.at_bound)
    return _Outcome(x, evaluation, covariance, found.at_bound, converged, message, True, unrest)


def _result(
    measurements: MeasurementSet,
    fitted: tuple[Group, ...],
    plain: PlainFit,
    outcome: _Outcome,
    report: StepReporter,
) -> Identification:
    layout, prior, start = report.layout, plain.start.prior, plain.start.x
    x, cov, at_bound = outcome.x, outcome.covariance, outcome.at_bound
    base = base_parameters(measurements.robot)
    jacobian = outcome.evaluation.jacobian * plain.solution.weights[:, :, None]
    left_out = plain.equation.signals.left_out
    held_out = _held_out_equation(measurements, plain)
    validation = () if held_out is None else held_out.signals.groups
    summary, series = _residuals(measurements, held_out, plain, outcome)
    estimates = parameter_estimates(layout, x, start, cov, at_bound, prior)
    lagging = not outcome.refined and not plain.observer.zero_phase
    if outcome.converged and not outcome.given and not lagging and (unrest := unexplained(summary)):
        outcome = replace(outcome, converged=False, unrest=unrest)
    message = outcome.message
    if not outcome.converged and not report.stopped and outcome.unrest is not None:
        message += f"; {why_not(outcome.unrest, layout, estimates, summary)}"
    if lagging and far_above_noise(summary).any():
        # the intervals do not include the error of a lagging observer
        estimates = tuple(
            replace(p, identifiable="weak") if p.identifiable == "yes" else p for p in estimates
        )
        message += "; the residual is far above the noise: this observer's own error is not in the intervals"
    return Identification(
        set_name=measurements.name,
        observer_name=plain.observer.name,
        bandwidth=plain.observer.bandwidth,
        gains=plain.observer.gains,
        refined=outcome.refined,
        groups=tuple(g.name for g in fitted if g.name not in left_out),
        validation_groups=tuple(g.name for g in validation),
        converged=outcome.converged,
        stopped=report.stopped,
        iterations=tuple(report.iterations),
        seconds=0.0,
        parameters=estimates,
        combinations=combinations(base, layout, x, cov.matrix, prior),
        residual=summary,
        model=layout.model(x),
        condition_number=condition_number(jacobian.reshape(-1, layout.size), layout, base, at_bound),
        covariance=cov.matrix,
        parameter_names=report.names,
        residuals=series,
        message=message,
    )


def _held_out_equation(measurements: MeasurementSet, plain: PlainFit) -> Equation | None:
    """On the validation groups that are long enough; None without one."""
    if not measurements.validation_groups:
        return None
    try:
        signals = build_signals(measurements, measurements.validation_groups, plain.observer)
        if left_out := signals.left_out:
            groups = tuple(g for g in measurements.validation_groups if g.name not in left_out)
            signals = build_signals(measurements, groups, plain.observer)
    except InputError:
        return None  # gaps, or too short: nothing is left
    return Equation(measurements.robot, signals, plain.equation.layout)


def _residuals(
    measurements: MeasurementSet, held_out: Equation | None, plain: PlainFit, outcome: _Outcome
) -> tuple[ResidualSummary, dict[str, ResidualSeries]]:
    """Of the fitted and the validation groups."""
    equation, evaluation, layout = plain.equation, outcome.evaluation, plain.equation.layout
    noise = segments_noise([b.segment for b in equation.signals.blocks])
    floor = np.sqrt(residual_noise(equation.signals, layout, outcome.x, evaluation.link, noise))
    series = _series(equation, evaluation)
    rms_validation = None
    if held_out is not None:
        result = held_out.evaluate(outcome.x)
        series |= _series(held_out, result)
        rms_validation = _rms(result.residual)
    rms = _rms(evaluation.residual)
    floors, spread = tuple(map(float, floor)), measurements.torque_spread
    point = equation.at(outcome.x, plain.solution.point)
    between = rms_between_reversals(equation, evaluation, point, outcome.x, floor)
    return ResidualSummary(layout.joints, rms, rms_validation, floors, spread, between), series


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
