"""A plan that repeats a measurement set in simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.simulation.control import PDController
from flexviz.model.simulation.plan import Plan, PlannedGroup
from flexviz.model.simulation.plant import Array
from flexviz.model.simulation.references import Sampled
from flexviz.model.simulation.sensors import Sensors
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import Robot

REFERENCE_BAND = 10.0  # [Hz] of the motor motion used as reference if a set has none
LONGEST_CYCLE = 0.001  # [s] of the simulated controller


def plan_from_set(measurements: MeasurementSet) -> Plan:
    """A plan with the set's robot, payloads and trajectories.

    The truth is what the set gives (CAD inertias, `[initial]` values), otherwise values proportional to the
    robot's inertia. Sensor noise is estimated from the recordings.
    """
    robot = measurements.robot
    inertia = inertia_along(robot, [group.segments[0].theta for group in measurements.groups])
    k, b, friction = proportional(inertia, measurements.initial_stiffness, measurements.initial_motor_inertia)
    step = measurements.groups[0].segments[0].step
    hold = measurements.torque_hold
    cycle = step / max(1, round(step / (hold if 0 < hold <= step else min(step, LONGEST_CYCLE))))
    if measurements.kp is not None and measurements.kd is not None:
        kp, kd = measurements.kp, measurements.kd
    else:
        kp, kd = position_gains(inertia, b)
    segments = [segment for group in measurements.groups for segment in group.segments]
    theta_noise, torque_noise = segments_noise(segments)
    return Plan(
        name=measurements.name,
        robot=robot,
        source=robot.source,
        model=FlexibleModel(robot.joints, k, b, friction, friction, robot.cad_parameters),
        payloads=dict(measurements.payloads),
        groups=tuple(planned(group) for group in measurements.groups),
        controller=PDController(kp, kd, cycle),
        sensors=Sensors(theta_noise, torque_noise),
        initial_stiffness=measurements.initial_stiffness,
        initial_motor_inertia=measurements.initial_motor_inertia,
        effects=measurements.effects,
        note=Fact("true-values", values={"from": "set"}),
        files={} if ":" in robot.source else {robot.source: robot.urdf_path.read_text(encoding="utf-8")},
    )


def planned(group: Group) -> PlannedGroup:
    """The group with its reference, or with its smoothed motor motion as reference."""
    if not group.segments:
        raise InputError(f'group "{group.name}" has no usable samples', file=group.file)
    step = group.segments[0].step
    start, end = group.segments[0].time[0], group.segments[-1].time[-1]
    time = np.arange(round((end - start) / step) + 1) * step
    wanted = group.at("theta_ref", start + time)
    if wanted is None or not np.isfinite(wanted).all():
        recorded = np.concatenate([segment.time for segment in group.segments]) - start
        theta = np.concatenate([segment.theta for segment in group.segments])
        wanted = np.column_stack([np.interp(time, recorded, column) for column in theta.T])
        wanted = smooth(wanted, step)
    return PlannedGroup(
        group.name,
        group.trajectory,
        group.payload,
        Sampled(time, wanted),
        duration=len(time) * step,
        record_step=step,
        validation=group.validation,
        temperature=None if group.temperature is None else tuple(map(float, group.temperature)),
    )


def smooth(theta: Array, step: float) -> Array:
    """θ (N, n) low-passed at `REFERENCE_BAND` without delay."""
    margin = min(len(theta) - 1, round(3.0 / (REFERENCE_BAND * step)))  # samples the filter needs to settle
    if 0.4 / step <= REFERENCE_BAND or margin < 10:
        return theta
    return sosfiltfilt(butter(4, REFERENCE_BAND, fs=1.0 / step, output="sos"), theta, axis=0, padlen=margin)


def inertia_along(robot: Robot, motions: Sequence[Array]) -> Array:
    """Mean diagonal (n,) of the mass matrix along motions (N, n), bounded away from zero [kg m²]."""
    data = robot.model.createData()
    diagonal = []
    for motion in motions:
        theta = robot.to_pin(motion)
        for q in theta[:: max(1, len(theta) // 20)]:
            diagonal.append(np.diag(pin.crba(robot.model, data, np.ascontiguousarray(q))).copy())
    mean = robot.from_pin(np.mean(diagonal, axis=0))
    return np.maximum(mean, 1e-3 * mean.max())


def proportional(
    inertia: Array, stiffness: Array | None = None, motor_inertia: Array | None = None
) -> tuple[Array, Array, Array]:
    """Stiffness [Nm/rad], motor inertia [kg m²] and viscous friction [Nm s/rad], where not given.

    All (n,), proportional to the link-side inertia [kg m²]: a joint that vibrates at 8 Hz.
    """
    b = 0.5 * inertia if motor_inertia is None else np.asarray(motor_inertia)
    k = (2 * np.pi * 8.0) ** 2 * inertia if stiffness is None else np.asarray(stiffness)
    return k, b, 0.5 * b


def position_gains(inertia: Array, motor_inertia: Array) -> tuple[Array, Array]:
    """Gains (n,) [Nm/rad], [Nm s/rad] of a position loop with a bandwidth of 8 Hz."""
    speed = 2 * np.pi * 8.0
    return (motor_inertia + inertia) * speed**2, 2.0 * (motor_inertia + inertia) * speed
