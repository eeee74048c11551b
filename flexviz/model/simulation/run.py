"""Simulate one run of a flexible-joint robot under its controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.model.compensation import FrictionTable
from flexviz.model.simulation import starting
from flexviz.model.simulation.building import make_plant
from flexviz.model.simulation.control import PDController, TorqueFilter
from flexviz.model.simulation.laws import ExtraLaw
from flexviz.model.simulation.loop import Compensate, Loop
from flexviz.model.simulation.plant import Array, Plant
from flexviz.model.simulation.references import Reference
from flexviz.model.simulation.sensors import Feedback, Seed, Sensors, rounded
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot

STARTS = ("rest", "moving")


@dataclass(frozen=True, eq=False)
class Run:
    """A simulated motion, N samples of n joints in the set's order.

    Attributes:
        time: (N,) [s].
        theta, theta_velocity: (N, n) motor side [rad], [rad/s]; theta as the sensors give it.
        q, q_velocity: (N, n) link side, exact.
        tau: (N, n) motor torque as recorded, sampled at the start of its hold, or filtered [Nm].
        tau_joint: (N, n) torque in the joints, exact [Nm].
        theta_ref: (N, n) reference [rad].
        torque_hold: how long each torque is held [s]; 0 for filtered ones.
        facts: how it was simulated.
    """

    time: Array
    theta: Array
    theta_velocity: Array
    q: Array
    q_velocity: Array
    tau: Array
    tau_joint: Array
    theta_ref: Array
    torque_hold: float
    facts: tuple[Fact, ...] = ()

    @property
    def note(self) -> str:
        """The facts in words."""
        return "; ".join(fact.text for fact in self.facts)

    def measured(self, sensors: Sensors, seed: Seed = None) -> Run:
        """This run as recorded by `sensors`: θ and τ get noise and resolution, not the torque filter."""
        samples, n = self.theta.shape
        return self.with_noise(sensors, *sensors.noise(samples, n, seed))

    def with_noise(self, sensors: Sensors, theta_noise: Array, torque_noise: Array) -> Run:
        """This run with noise (N, n) and with the resolution of `sensors`."""
        theta = rounded(self.theta + theta_noise, sensors.resolution)
        return replace(self, theta=theta, tau=rounded(self.tau + torque_noise, sensors.torque_resolution))


def simulate_run(
    robot: Robot,
    model: FlexibleModel,
    *,
    payload: Sequence[PayloadBody] = (),
    reference: Reference,
    controller: PDController,
    duration: float,
    step: float | None = None,
    record_step: float | None = None,
    start: str = "rest",
    sensors: Sensors | None = None,
    seed: Seed = None,
    group: str | None = None,
    payload_name: str | None = None,
    temperature: Sequence[float] | None = None,
    laws: Sequence[tuple[str, ExtraLaw]] = (),
    compensation: FrictionTable | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Run:
    """Simulate `robot` with the parameters of `model` following `reference` for `duration` [s].

    `step` is the largest integration step [s] (None: from the fastest motion), `record_step` the recording's
    step [s] (None: every controller cycle). `start` "rest": in static equilibrium at θ_d(0); "moving": on the
    reference, with its velocity. `temperature` (n,) in °C. `laws` are (joint, law) beyond the library's.
    `compensation` adds its torque at the reference's speed and the commanded torque; τ is recorded without.

    Raises:
        Cancelled: `should_stop` returned True.
    """
    if start not in STARTS:
        raise InputError(f'start "{start}" does not exist; valid: {", ".join(STARTS)}')
    every = _cycles_per_record(record_step or controller.cycle, cycle := controller.cycle)
    n, time = robot.n, np.arange(round(duration / cycle)) * cycle
    position, velocity = (robot.to_pin(x) for x in reference.sample(time))
    plant, torque_path = make_plant(
        robot, model, payload, group=group, payload_name=payload_name, temperature=temperature
    )
    plant.extra += [(int(robot.order[robot.joints.index(joint)]), law) for joint, law in laws]
    kp, kd = (robot.to_pin(np.broadcast_to(gain, n)) for gain in (controller.kp, controller.kd))
    if start == "rest":
        x, tau = starting.at_rest(plant, position[0], kp)
    else:
        x = starting.moving(plant, lambda t: robot.to_pin(reference.sample(t)[0]))
        tau = kp * (position[0] - x[n : 2 * n]) + kd * (velocity[0] - x[3 * n : 4 * n])
    smooth = None if controller.torque_filter is None else TorqueFilter(controller.torque_filter, cycle, tau)
    feedback = _feedback(robot, sensors, x, len(time), cycle, seed)
    beside = None if compensation is None else _compensate(robot, compensation, velocity)
    target = kp * position + kd * velocity
    # the record saturates, the motor gets all that is commanded
    path, record_limit = replace(torque_path, limit=np.full(n, np.inf)), torque_path.limit
    loop = Loop(plant, path, target, kp, kd, cycle, smooth, feedback, beside, step)
    states, torques = loop.drive(x, tau, None, progress, should_stop)
    hold = cycle
    if sensors is not None and sensors.torque_filter:
        torques, hold = sensors.filtered(torques, cycle), 0.0
    run = to_run(robot, plant, time[::every], states[::every], torques[::every], position[::every], hold)
    return _limited(_measured(run, robot, sensors, feedback, every, seed), robot, record_limit)


def _measured(
    run: Run, robot: Robot, sensors: Sensors | None, feedback: Feedback | None, every: int, seed: Seed
) -> Run:
    """The run as its sensors record it, with the noise that the controller saw."""
    if sensors is None:
        return run
    if feedback is None:
        return run.measured(sensors, seed)
    noise = (robot.from_pin(x[::every]) for x in (feedback.noise, feedback.torque_noise))
    return run.with_noise(sensors, *noise)


def _limited(run: Run, robot: Robot, limit: Array) -> Run:
    """The run with a recorded torque within ±limit (n,), in Pinocchio's joint order [Nm]."""
    most = robot.from_pin(limit)
    return replace(run, tau=np.clip(run.tau, -most, most)) if np.isfinite(most).any() else run


def _feedback(
    robot: Robot, sensors: Sensors | None, x: Array, cycles: int, cycle: float, seed: Seed
) -> Feedback | None:
    """What the controller measures from the initial state x on; None: the true motion."""
    if sensors is None or not sensors.feedback:
        return None
    n = robot.n
    own = sensors.reordered(robot.to_pin, n)
    return Feedback(own, cycles, cycle, x[n : 2 * n], x[3 * n : 4 * n], seed)


def _compensate(robot: Robot, table: FrictionTable, velocity: Array) -> Compensate:
    """The table's torque by the reference's velocity (cycles, n), in Pinocchio's joint order."""
    wanted = robot.from_pin(velocity)
    return lambda k, tau: robot.to_pin(table.torque(wanted[k], robot.from_pin(tau)))


def _cycles_per_record(record_step: float, cycle: float) -> int:
    """Controller cycles per recorded sample; both arguments in s."""
    every = max(1, round(record_step / cycle))
    if abs(every * cycle - record_step) > 1e-9:
        raise InputError(f"record step {record_step} s is not a multiple of the controller cycle {cycle} s")
    return every


def to_run(
    robot: Robot, plant: Plant, time: Array, states: Array, torques: Array, position: Array, hold: float
) -> Run:
    """A Run from states (N, 4n + …), torques and references (N, n) in Pinocchio's joint order."""
    n = robot.n
    q, theta, qv, thetav = (robot.from_pin(states[:, i * n : (i + 1) * n]) for i in range(4))
    return Run(
        time=time,
        theta=theta,
        theta_velocity=thetav,
        q=q,
        q_velocity=qv,
        tau=robot.from_pin(torques),
        tau_joint=robot.from_pin(plant.joint_torque(states, time)),
        theta_ref=robot.from_pin(position),
        torque_hold=hold,
    )
