"""Simulation of an identified model along a recorded group.

Closed loop if the set has controller gains and reference: the same controller drives the model. Otherwise the
recorded torque drives it, with a weak PD on (measured − simulated) θ against drift. A fact tells which.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never, part
from flexviz.data.measurements import Group, Segment
from flexviz.model.servo import follows_goals
from flexviz.model.simulation import rates, starting
from flexviz.model.simulation.building import TorquePath, make_plant, without_unsimulated
from flexviz.model.simulation.goal_replay import replay_goals
from flexviz.model.simulation.loop import Loop
from flexviz.model.simulation.plant import Array, Plant
from flexviz.model.simulation.references import Sampled
from flexviz.model.simulation.resimulating import smooth
from flexviz.model.simulation.run import Run, to_run
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import Robot

LONGEST_CYCLE = 0.001  # [s] of a held torque
FASTEST_VIBRATION = 2000.0  # [rad/s] to which stiffer joints are softened
PD_BAND = 2.0 * np.pi * 2.0  # [rad/s] of the stabilising PD
START_TIME = 0.3  # [s] of the polynomial fitted to the initial motion
TRIAL_TIME = 0.1  # [s] simulated to choose the initial state


def replay(
    robot: Robot,
    model: FlexibleModel,
    group: Group,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    *,
    torque_hold: float = 0.0,
    duration: float | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Run:
    """Forward simulation of `model` along `group`, sampled at the group's own instants.

    `kp`, `kd` (n,) and `torque_hold` are the measurement set's; `duration` [s] limits what is simulated.
    `time` of the result is the segments' times one after the other; `theta` is the model's own motor motion.
    """
    if not group.segments:
        raise InputError(f'group "{group.name}" has no usable samples', file=group.file)
    if follows_goals(model):
        return replay_goals(robot, model, group)
    closed = kp is not None and kd is not None and group.theta_ref is not None
    closed = closed and bool(np.isfinite(group.theta_ref).all())  # type: ignore[arg-type]
    step = group.segments[0].step
    cycle = step / _cycles_per_sample(step, torque_hold if closed else 0.0)
    gain = np.broadcast_to(np.asarray(kd, dtype=float), robot.n) if closed else None
    model, left_out = without_unsimulated(model)
    model, changes = _resolvable(robot, model, group, gain, cycle)
    plant, torque_path = make_plant(
        robot,
        model,
        group.bodies,
        group=group.name,
        payload_name=group.payload,
        temperature=group.temperature,
    )
    gains = (kp, kd) if closed else _weak_gains(robot, plant, group)
    total = sum(len(segment) for segment in group.segments)
    runs: list[Run] = []
    done, left = 0, np.inf if duration is None else duration
    for segment in group.segments:
        if left <= 0.0:
            break
        count = len(segment) if left == np.inf else min(len(segment), ceil(left / segment.step) + 1)
        segment = _first(segment, count)
        report = part(progress, done / total, (done + count) / total)
        runs.append(
            _replay_segment(
                robot, plant, torque_path, group, segment, gains, closed, torque_hold, report, should_stop
            )
        )
        done, left = done + count, left - count * segment.step
    progress(Progress("simulating", 1.0))
    loop = Fact("replayed", values={"loop": "closed" if closed else "open"})
    return _joined(runs, (loop, *left_out, *changes))


def _replay_segment(
    robot: Robot,
    plant: Plant,
    torque_path: TorquePath,
    group: Group,
    segment: Segment,
    gains: tuple,
    closed: bool,
    torque_hold: float,
    progress: ProgressCallback,
    should_stop: StopCallback,
) -> Run:
    n, step, start = robot.n, segment.step, segment.time[0]
    kp, kd = (robot.to_pin(np.broadcast_to(np.asarray(g, dtype=float), n)) for g in gains)
    per_sample = _cycles_per_sample(step, torque_hold if closed else 0.0)
    cycle = step / per_sample
    own = segment.time - start  # [s]
    time = np.arange(len(own) * per_sample) * cycle
    if closed:
        wanted = group.at("theta_ref", segment.time)
        assert wanted is not None
        position, velocity = (robot.to_pin(x) for x in Sampled(own, wanted).sample(time))
        target = kp * position + kd * velocity
    else:
        position, velocity = (robot.to_pin(x) for x in Sampled(own, smooth(segment.theta, step)).sample(time))
        middle = time + 0.5 * cycle - 0.5 * torque_hold
        tau = np.column_stack([np.interp(middle, own, column) for column in segment.tau.T])
        target = kp * position + kd * velocity + robot.to_pin(tau)
    loop = Loop(plant, torque_path, target, kp, kd, cycle)
    x, before = _start(robot, plant, loop, segment, position, per_sample)
    states, torques = loop.drive(x, before, None, progress, should_stop)
    take = slice(None, None, per_sample)
    return to_run(robot, plant, segment.time, states[take], torques[take], position[take], cycle)


def _cycles_per_sample(step: float, torque_hold: float) -> int:
    longest = torque_hold if 0.0 < torque_hold < step else LONGEST_CYCLE
    return max(1, ceil(step / longest - 1e-9))


def _start(
    robot: Robot, plant: Plant, loop: Loop, segment: Segment, aim: Array, per_sample: int
) -> tuple[Array, Array]:
    """The initial state that fits the start best: at rest, or moving as measured or as the reference."""
    n = robot.n
    count = min(len(segment), max(8, round(START_TIME / segment.step)))
    own = segment.time[:count] - segment.time[0]
    candidates = [starting.at_rest(plant, aim[0], loop.kp)]
    theta0 = robot.to_pin(segment.theta[: min(4, count)]).mean(axis=0)
    candidates.append((starting.at_rest(plant, theta0, np.zeros(n))[0], candidates[0][1]))
    for motion, degree in (
        (robot.to_pin(segment.theta[:count]), 4),
        (aim[: count * per_sample : per_sample], 6),
    ):
        fits = [Polynomial.fit(own, column, min(degree, count - 1)) for column in motion.T]
        x = starting.moving(plant, lambda t, fits=fits: np.column_stack([fit(t) for fit in fits]), 0.02, 6)
        candidates.append((x, loop.target[0] - loop.kp * x[n : 2 * n] - loop.kd * x[3 * n : 4 * n]))
    measured = robot.to_pin(segment.theta[: max(2, round(TRIAL_TIME / segment.step))])
    cycles = (len(measured) - 1) * per_sample + 1
    errors = []
    for state, before in candidates:
        states, _ = loop.drive(state, before, cycles)
        errors.append(float(np.square(states[::per_sample, n : 2 * n] - measured).mean()))
    return candidates[int(np.argmin(errors))]


def _weak_gains(robot: Robot, plant: Plant, group: Group) -> tuple[Array, Array]:
    """Gains (n,) of a critically damped PD of `PD_BAND` for the motors and links together."""
    data = plant.model.createData()
    q = robot.to_pin(group.segments[0].theta[0])
    mass = np.diag(pin.crba(plant.model, data, np.ascontiguousarray(q))) + np.diag(plant.motor_inertia)
    inertia = robot.from_pin(mass)
    return inertia * PD_BAND**2, 2.0 * inertia * PD_BAND


def _resolvable(
    robot: Robot, model: FlexibleModel, group: Group, kd: Array | None, cycle: float
) -> tuple[FlexibleModel, list[Fact]]:
    """The model with stiffness and motor inertia limited to what can be simulated, and what was changed."""
    plant, _ = make_plant(robot, model, group.bodies)
    data = plant.model.createData()
    q = robot.to_pin(group.segments[0].theta[0])
    mobility = robot.from_pin(np.diag(pin.computeMinverse(plant.model, data, np.ascontiguousarray(q))))
    least = np.maximum(1e-3 / mobility, model.motor_viscous_friction / FASTEST_VIBRATION)
    least = least if kd is None else np.maximum(least, kd * cycle)  # else the controller itself is unstable
    inertia = np.maximum(model.motor_inertia, least)
    stiffness = np.minimum(model.stiffness, FASTEST_VIBRATION**2 / (mobility + 1.0 / inertia))
    softer, heavier = (stiffness < model.stiffness), (inertia > model.motor_inertia)
    model = replace(model, stiffness=stiffness, motor_inertia=inertia)
    plant, _ = make_plant(robot, model, group.bodies)
    vibration = rates.fastest(plant, q[None]).vibration
    if vibration > 2.0 * FASTEST_VIBRATION:
        model = replace(model, stiffness=stiffness * (2.0 * FASTEST_VIBRATION / vibration) ** 2)
        softer[:] = True
    changed = [
        Fact("limited", "odd", joints, values={"what": what})
        for what, which in (("stiffness", softer), ("motor_inertia", heavier))
        if (joints := tuple(joint for joint, yes in zip(model.joints, which, strict=True) if yes))
    ]
    return model, changed


def _first(segment: Segment, count: int) -> Segment:
    if count >= len(segment):
        return segment
    return Segment(segment.time[:count], segment.theta[:count], segment.tau[:count], segment.step)


def _joined(runs: list[Run], facts: tuple[Fact, ...]) -> Run:
    names = ("time", "theta", "theta_velocity", "q", "q_velocity", "tau", "tau_joint", "theta_ref")
    arrays = {name: np.concatenate([getattr(run, name) for run in runs]) for name in names}
    return Run(**arrays, torque_hold=runs[0].torque_hold, facts=facts)
