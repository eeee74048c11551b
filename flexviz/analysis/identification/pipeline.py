"""Identification of a flexible-joint robot from motor-side data, end to end."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.analysis.estimation import Stopped, base_parameters, residual_noise, torque_scale
from flexviz.analysis.identification.by_free_motion import by_free_motion
from flexviz.analysis.identification.estimator import Estimator
from flexviz.analysis.identification.failure import (
    Unrest,
    far_above_noise,
    unexplained,
    unrest_of,
    why_not,
)
from flexviz.analysis.identification.likely_addition import likely_move, likely_move_in_motion
from flexviz.analysis.identification.link_side_check import link_side_checks
from flexviz.analysis.identification.messages import (
    groups_not_used,
    holds_used,
    of_samples,
)
from flexviz.analysis.identification.plain_fit import PlainFit, StepReporter, plain_fit
from flexviz.analysis.identification.plots import remember
from flexviz.analysis.identification.result import Identification, ResidualSeries
from flexviz.analysis.identification.settings import FitOptions, FitSettings, fit_settings
from flexviz.analysis.identification.stated_error import stated_residual
from flexviz.analysis.identification.summary import combinations, condition_number, parameter_estimates
from flexviz.analysis.identification.uncertainty import Stated, Uncertainty, uncertainty
from flexviz.analysis.motion import MotionFit, Phases
from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.progress import ProgressCallback, StopCallback
from flexviz.checks import check_signals, recording_entries
from flexviz.content.records import ResidualSummary, normalised
from flexviz.data.measurements import Group, MeasurementSet, set_of
from flexviz.data.noise import segments_noise
from flexviz.model.equation import Equation, Evaluation, Layout, build_signals, layout_of
from flexviz.robot.model import FlexibleModel


def identify(
    measurements: MeasurementSet | str | Path,
    settings: FitSettings | None = None,
    *,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    model: FlexibleModel | None = None,
    **options: Unpack[FitOptions],
) -> Identification:
    """Estimate stiffness, motor inertia, friction, inertial parameters and effects.

    With s = τ − B θ̈ − f_m the link angle is q = θ − s/K, so that the link equation r = s − Y(q, q̇, q̈) Γ − f_l
    holds for θ, τ and their derivatives, which an observer provides. Σ (r/σ)² and a prior are minimised; then
    instrumental variables remove the observer's bias. Intervals include what the model lacks.

    Args:
        measurements: the set, or its folder.
        settings: how, of which `options` change some; None: the defaults.
        progress: called after each step.
        should_stop: asked after each step; what was found so far is returned.
        model: values to take instead of fitting them; the result has their errors and residuals.
        options: fields of `FitSettings`.

    Raises:
        InputError: unknown names, a validation group, nothing left to fit, or signals that are no motion
            of a robot.
    """
    began, measurements = time.perf_counter(), set_of(measurements)
    chosen = fit_settings(settings, **options)
    if measurements.drive is not None:
        found = by_free_motion("identify_servos")(measurements, chosen, progress, should_stop, model)
        return remember(found, measurements)
    fitted, held_out = measurements.select(chosen.groups)
    noise = check_signals(measurements, (*fitted, *held_out))
    with threadpool_limits(1, "blas"):  # the matrices are small: threads would only wait for each other
        layout = _layout(measurements, fitted, chosen.effects)
        report = StepReporter(layout, progress, should_stop)
        plain = plain_fit(measurements, fitted, chosen, report, model)
        outcome, move = _plain_outcome(plain), np.zeros(layout.size)
        if model is not None:
            outcome = replace(outcome, facts=(Fact("values-given"),), given=True)
        elif chosen.refine and not report.stopped:
            outcome = _estimated_outcome(measurements, fitted, plain, outcome, report)
        if model is None and not report.stopped and not outcome.explained:
            with suppress(Stopped):
                if outcome.in_motion is None:
                    move = likely_move(measurements, plain)
                else:
                    move = likely_move_in_motion(outcome.in_motion, report.watch)
        report.stage = "intervals"
        known = uncertainty(outcome.stated, layout, outcome.at_bound, move)
        if report.stopped:
            outcome = replace(outcome, converged=False, facts=(Fact("fit-stopped", "odd"),))
        result = _result(measurements, fitted, plain, outcome, known, report)
    result = replace(result, residual=_with_noise_share(result.residual, noise))
    more = *groups_not_used(result, (*fitted, *held_out)), *holds_used(plain, result.model)
    result = replace(result, facts=(*result.facts, *more, *of_samples(measurements)))
    result = replace(result, recording=recording_entries(measurements))
    return remember(replace(result, seconds=time.perf_counter() - began), measurements)


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
        at_bound: shape (P,).
        stated: the covariances of the parameters.
        converged, refined, facts: as in `Identification`.
        unrest: what keeps the fit from converging.
        given: the values were not fitted.
        explained: noise explains what the refinement leaves.
        in_motion: the fit in the band of the motion, if it is that.
        first_phase: shape (n,), first phase of each joint's motion that counts; None: all do.
    """

    x: Array
    evaluation: Evaluation
    at_bound: Bools
    stated: Stated
    converged: bool
    facts: tuple[Fact, ...]
    refined: bool = False
    unrest: Unrest | None = None
    given: bool = False
    explained: bool = False
    in_motion: MotionFit | None = None
    first_phase: Phases | None = None


def _plain_outcome(plain: PlainFit) -> _Outcome:
    end = plain.solution
    fact = Fact("converged") if end.converged else Fact("not-converged", "wrong")
    unrest = None if end.converged else unrest_of(end, plain.start, plain.equation.layout)
    return _Outcome(end.x, end.evaluation, end.at_bound, plain.stated, end.converged, (fact,), unrest=unrest)


def _estimated_outcome(
    measurements: MeasurementSet,
    groups: tuple[Group, ...],
    plain: PlainFit,
    outcome: _Outcome,
    report: StepReporter,
) -> _Outcome:
    """The estimator's result; the plain one where it is stopped."""
    report.stage = "refine"
    estimator = Estimator(measurements, groups)
    try:
        report.check()
        found = estimator.estimate(report.layout, outcome.x, check=report.watch, report=report)
        of_motion = None if found.refined else estimator.context.fit(report.layout, found.x, iterations=0)
    except Stopped:
        return outcome
    x = found.x
    evaluation = plain.equation.at(x, plain.solution.point).evaluate(x)
    return replace(
        outcome, x=x, evaluation=evaluation, at_bound=found.at_bound, stated=found.stated,
        facts=(found.fact,), converged=True, refined=True, unrest=None,
        explained=found.at_noise, in_motion=of_motion, first_phase=found.first_phase,
    )  # fmt: skip


def _result(
    measurements: MeasurementSet,
    fitted: tuple[Group, ...],
    plain: PlainFit,
    outcome: _Outcome,
    known: Uncertainty,
    report: StepReporter,
) -> Identification:
    layout, prior, start = report.layout, plain.start.prior, plain.start.x
    x, cov, at_bound = outcome.x, known.covariance, outcome.at_bound
    base = base_parameters(measurements.robot)
    jacobian = outcome.evaluation.jacobian * plain.solution.weights[:, :, None]
    left_out, held_out = plain.equation.signals.left_out, _held_out_equation(measurements, plain)
    validation = () if held_out is None else held_out.signals.groups
    found = _residuals(measurements, held_out, plain, outcome)
    samples = plain.equation.signals.count * layout.n
    estimates = parameter_estimates(
        layout, x, start, cov, at_bound, prior, unbound=known.unbound, samples=samples
    )
    lagging = not outcome.refined and not plain.observer.zero_phase
    if outcome.converged and not outcome.given and not lagging and (unrest := unexplained(found.own)):
        outcome = replace(outcome, converged=False, unrest=unrest)
    facts = list(outcome.facts)
    if not outcome.converged and not report.stopped and outcome.unrest is not None:
        facts += why_not(outcome.unrest, layout, estimates, found.own)
    if lagging and far_above_noise(found.own).any():
        # the intervals do not include the error of a lagging observer
        estimates = tuple(
            replace(p, identifiable="weak") if p.identifiable == "yes" else p for p in estimates
        )
        facts.append(Fact("observer-lags", "odd"))
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
        residual=found.stated,
        model=layout.model(x),
        condition_number=condition_number(jacobian.reshape(-1, layout.size), layout, base, at_bound),
        covariance=cov.matrix,
        chance=known.chance.matrix,
        parameter_names=report.names,
        residuals=found.series,
        facts=tuple(facts),
        link_side=link_side_checks(
            measurements,
            x[layout.inertial].reshape(-1, 10),
            cov.matrix[layout.inertial, layout.inertial],
            estimates[layout.compliance],
        ),
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


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Residuals of a fit.

    Attributes:
        stated: the errors that are told, in the band of all errors, whatever the observer.
        own: with the fit's own observer, by which the fit itself is judged.
        series: over time, with the fit's own observer.
    """

    stated: ResidualSummary
    own: ResidualSummary
    series: dict[str, ResidualSeries]


def _residuals(
    measurements: MeasurementSet, held_out: Equation | None, plain: PlainFit, outcome: _Outcome
) -> _Residuals:
    """Of the fitted and the validation groups."""
    equation, evaluation, layout = plain.equation, outcome.evaluation, plain.equation.layout
    noise = segments_noise([b.segment for b in equation.signals.blocks])
    scale = torque_scale(layout, outcome.x)
    variance = residual_noise(equation.signals, layout, outcome.x, evaluation.link, noise)
    floor = np.sqrt(variance) / scale
    series = _series(equation, evaluation, scale, floor)
    rms_validation = None
    if held_out is not None:
        result = held_out.evaluate(outcome.x)
        series |= _series(held_out, result, scale, floor)
        rms_validation = _rms(held_out, result, scale)
    rms, spread = _rms(equation, evaluation, scale), measurements.torque_spread
    units, noisy = measurements.torque_units, tuple(map(float, floor))
    own = ResidualSummary(layout.joints, rms, rms_validation, noisy, spread, units=units)
    fitted = tuple(group.name for group in equation.signals.groups)
    try:
        stated = stated_residual(measurements, layout, outcome.x, fitted, outcome.first_phase)
    except InputError:  # records too short for the band of all errors
        stated = own
    return _Residuals(stated, own, series)


def _rms(equation: Equation, evaluation: Evaluation, scale: Array) -> tuple[float, ...]:
    return tuple(map(float, np.sqrt(equation.signals.mean_square(evaluation.residual)) / scale))


def _series(
    equation: Equation, evaluation: Evaluation, scale: Array, floor: Array
) -> dict[str, ResidualSeries]:
    """Residuals over time in units of the recorded torque; `scale` and `floor`, shape (n,)."""
    out, residual = {}, evaluation.residual / scale
    signals = equation.signals
    for index, group in enumerate(signals.groups):
        parts = [b.rows for b in signals.blocks if b.group == index]
        if not parts:
            continue
        rows = np.concatenate([np.arange(p.start, p.stop) for p in parts])
        out[group.name] = ResidualSeries(
            signals.time[rows], residual[rows], evaluation.torque[0][rows], evaluation.q[0][rows], floor
        )
    return out
