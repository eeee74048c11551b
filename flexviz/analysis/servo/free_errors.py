"""A given model of joints that follow goals: errors of its free motion, over time and by variable."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from flexviz.analysis.diagnosis import SLOW, SlowResidual, TorqueOverTime, joint_maps
from flexviz.analysis.estimation import PredictionErrors
from flexviz.analysis.servo.judge import TrajectoryJudge
from flexviz.base.arrays import Array
from flexviz.base.units import joint_unit
from flexviz.content.records import ResidualMap
from flexviz.data.measurements import MeasurementSet
from flexviz.model.servo import INDEX, servo_values
from flexviz.robot.model import FlexibleModel

SPARE = 0.05  # [s] between the samples of a map, which are below 5 Hz


def judge_of(measurements: MeasurementSet, values: Array) -> TrajectoryJudge:
    """The judge of a model with parameters (P, n), as the diagnosis judges its last one."""
    return TrajectoryJudge(measurements).refreshed(values)


def free_errors(measurements: MeasurementSet, model: FlexibleModel) -> PredictionErrors:
    """Errors of a model's free motion [rad]."""
    values = servo_values(model)
    return judge_of(measurements, values).errors(values)


def free_over_time(
    measurements: MeasurementSet, group: str, models: Sequence[FlexibleModel]
) -> TorqueOverTime:
    """How far the goals of a group are ahead of its motion [rad], and what models leave of that."""
    chosen = measurements.group(group)
    found = [judge_of(measurements, servo_values(one)).runs(servo_values(one))[group] for one in models]
    return TorqueOverTime(chosen.joined("time"), chosen.joined("tau"), tuple(one.error for one in found))


def free_maps(
    measurements: MeasurementSet, model: FlexibleModel, check: Callable[[], None] = lambda: None
) -> tuple[ResidualMap, ...]:
    """Maps of the free motion's error [rad] against each variable but frequency; load is kp (goal − θ)."""
    values = servo_values(model)
    runs = judge_of(measurements, values).runs(values)
    parts: list[tuple[Array, ...]] = []
    stretches, group, at = [], [], 0
    for k, one in enumerate(measurements.groups):
        error, before = runs[one.name].error, 0
        for segment in one.segments:
            check()
            rows, every = slice(before, before + len(segment)), max(1, int(SPARE / segment.step))
            theta = SLOW.derivatives(segment.theta, segment.step, 3, position=True, stride=every)
            slow = SLOW.derivatives(error[rows], segment.step, 1, stride=every)[0]
            count, step = len(slow), every * segment.step
            edge = min(round(1.0 / step), count // 4)  # how the motion began, and of the low-pass
            shown = np.zeros(count, bool)
            shown[edge : count - edge] = True
            load, time = values[INDEX["gain"]] * segment.tau[::every], segment.time[::every]
            slow = slow * shown[:, None]
            parts.append((shown, time, np.full(count, step), slow, np.moveaxis(theta, 0, 1), load))
            group.append(np.full(count, k))
            stretches.append(slice(at, at + count))
            at, before = at + count, before + len(segment)
    shown, time, step, residual, theta, load = (np.concatenate(p) for p in zip(*parts, strict=True))
    data = SlowResidual(
        measurements.joints, tuple(g.name for g in measurements.groups), np.concatenate(group),
        tuple(stretches), shown, time, step, residual, np.moveaxis(theta, 1, 0), load,
    )  # fmt: skip
    return tuple(
        _of_joint(one, bool(slides))
        for j, slides in enumerate(measurements.robot.prismatic)
        for one in joint_maps(data, j)
    )


def _of_joint(one: ResidualMap, slides: bool) -> ResidualMap:
    return replace(one, unit=joint_unit(one.unit, slides))
