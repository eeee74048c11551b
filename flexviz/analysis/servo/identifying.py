"""Identification of joints that follow goals."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.analysis.identification import FitSettings, Identification, ResidualSeries
from flexviz.analysis.servo.course import ServoCourse, with_settings
from flexviz.analysis.servo.estimate import ServoEstimate
from flexviz.analysis.servo.problem import STEPS
from flexviz.base.facts import Fact
from flexviz.base.progress import ProgressCallback, StopCallback
from flexviz.content.records import ResidualSummary, normalised
from flexviz.data.measurements import MeasurementSet
from flexviz.model.servo import BAND, INDEX, servo_values
from flexviz.robot.model import FlexibleModel

OBSERVER = "butterworth-zero-phase"  # of the accelerations of the measured motion


def identify_servos(
    measurements: MeasurementSet,
    settings: FitSettings,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    model: FlexibleModel | None = None,
) -> Identification:
    """Estimate gain, inertia, friction and effects of every servo; arguments as of `identify`."""
    measurements = with_settings(measurements, settings)
    with threadpool_limits(1, "blas"):
        course = ServoCourse(measurements, progress, should_stop)
        course.say(Fact("servo-stage", values={"stage": "fit"}))
        course.searching = False  # a fit takes seconds, and half of one is of no use
        given = None if model is None else servo_values(model)
        estimate = course.finished(course.problem.begin(), STEPS, given)
        how = Fact("servo-fitted") if given is None else Fact("servo-given")
        return identification(course, estimate, how)


def identification(course: ServoCourse, estimate: ServoEstimate, how: Fact) -> Identification:
    """The result of a model; `how` its values were found."""
    set_, judge = course.measurements, course.judge.refreshed(estimate.values)
    errors, runs = judge.errors(estimate.values), judge.runs(estimate.values)
    parameters, noise = estimate.parameters(), np.array(judge.noise)
    names = tuple(p.label for p in parameters)
    gain = estimate.values[INDEX["gain"]]
    series = {
        g.name: ResidualSeries(
            runs[g.name].time, runs[g.name].error, gain * g.joined("tau"), runs[g.name].theta, noise
        )
        for g in set_.groups
    }
    std = np.array([p.std for p in parameters])
    summary = ResidualSummary(
        set_.joints, errors.rms, errors.rms_validation, errors.noise_floor, errors.spread,
        noise_share=tuple(np.nan_to_num(normalised(errors.noise_floor, errors.spread)).tolist()),
        units=set_.torque_units,
    )  # fmt: skip
    facts = (how, *notes(estimate))
    return Identification(
        set_name=set_.name, observer_name=OBSERVER, bandwidth=float(2 * np.pi * BAND),
        groups=tuple(g.name for g in set_.fit_groups),
        validation_groups=tuple(g.name for g in set_.validation_groups),
        iterations=(), seconds=time.perf_counter() - course.began, parameters=parameters,
        combinations=estimate.ratios(), residual=summary, model=estimate.model(),
        covariance=np.diag(np.nan_to_num(std) ** 2), parameter_names=names, residuals=series, facts=facts,
        stopped=course.stopped,
    )  # fmt: skip


def notes(estimate: ServoEstimate) -> Iterator[Fact]:
    """What a user has to know of the parameters."""
    joints = estimate.measurements.joints
    unknown = tuple(j for j, sure in zip(joints, estimate.determined, strict=True) if not sure)
    if unknown:
        yield Fact("no-scale", "odd", joints=unknown)
