"""Simulate one run of a flexible-joint robot under its controller."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import floor

import numpy as np

from flexviz.errors import Cancelled, ConvergenceError, InputError
from flexviz.model import FlexibleModel
from flexviz.robot import PayloadBody, Robot
from flexviz.simulation import rates, starting
from flexviz.simulation.building import make_plant
from flexviz.simulation.control import Controller, TorqueFilter
from flexviz.simulation.plant import Array
from flexviz.simulation.references import Reference
from flexviz.simulation.sensors import Sensors

Progress = Callable[[float], None]
STARTS = ("rest", "moving")
_EVERY = 1024  # cycles between two looks at progress and should_stop


@dataclass(frozen=True, eq=False)
class Run:
    """A simulated motion, N samples of n joints in the set's order.

    Attributes
    ----------
    time: (N,) [s].
    theta, theta_velocity: (N, n) motor side [rad], [rad/s]; theta as the sensors give it.
    q, q_velocity: (N, n) link side, exact.
    tau: (N, n) motor torque as recorded, sampled at the start of its hold [Nm].
    tau_joint: (N, n) torque in the joints, exact [Nm].
    theta_ref: (N, n) reference [rad].
    torque_hold: how long each torque is held [s].
    note: what a reader should know about how it was simulated.
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
    note: str = ""

    def measured(self, sensors: Sensors, seed: int | np.random.Generator | None = None) -> Run:
        """This run as recorded by `sensors`: θ and τ get noise and resolution."""
        samples, n = self.theta.shape
        theta_noise, torque_noise = sensors.noise(samples, n, seed)
        theta = sensors.quantise(self.theta + theta_noise)
        return replace(self, theta=theta, tau=self.tau + torque_noise)


def simulate_run(
    robot: Robot,
    model: FlexibleModel,
    *,
    payload: Sequence[PayloadBody] = (),
    reference: Reference,
    controller: Controller,
    duration: float,
    step: float | None = None,
    record_step: float | None = None,
    start: str = "rest",
    sensors: Sensors | None = None,
    seed: int | np.random.Generator | None = None,
    group: str | None = None,
    payload_name: str | None = None,
    progress: Progress | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Run:
    """Simulate `robot` with the parameters of `model` following `reference` for `duration` [s].

    `step` is the largest integration step [s] (None: chosen from the fastest motion), `record_step` the
    recording's step [s] (None: every controller cycle). `start` "rest": in static equilibrium at θ_d(0);
    "moving": on the reference, with its velocity. `progress` gets the share done; when `should_stop` says so
    the simulation ends with Cancelled.
    """
    if start not in STARTS:
        raise InputError(f'start "{start}" does not exist; valid: {", ".join(STARTS)}')
    cycle = controller.cycle
    every = max(1, round((record_step or cycle) / cycle))
    if record_step is not None and abs(every * cycle - record_step) > 1e-9:
        raise InputError(f"record step {record_step} s is not a multiple of the controller cycle {cycle} s")
    cycles = round(duration / cycle)
    time = np.arange(cycles) * cycle
    position, velocity = (robot.to_pin(x) for x in reference.sample(time))
    plant, recorder = make_plant(robot, model, payload, group=group, payload_name=payload_name)
    kp, kd = (
        np.broadcast_to(robot.to_pin(np.atleast_1d(g)), (robot.n,)) for g in (controller.kp, controller.kd)
    )

    n = robot.n
    if start == "rest":
        x, tau = starting.at_rest(plant, position[0], kp)
    else:
        x = starting.moving(plant, lambda t: robot.to_pin(reference.sample(t)[0]))
        tau = kp * (position[0] - x[n : 2 * n]) + kd * (velocity[0] - x[3 * n : 4 * n])
    smooth = None if controller.torque_filter is None else TorqueFilter(controller.torque_filter, cycle, tau)

    whole = floor(recorder.delay / cycle + 1e-9)
    rest = max(0.0, recorder.delay - whole * cycle)
    rest = 0.0 if rest < 1e-9 else rest
    fine = rates.substeps(plant, position[:: max(1, cycles // 12)], cycle)
    fine = fine if step is None else max(1, round(cycle / step))
    parts = (
        [(0.0, cycle, fine, 0)]
        if not rest
        else [
            (0.0, rest, max(1, round(fine * rest / cycle)), 1),
            (rest, cycle - rest, max(1, round(fine * (1 - rest / cycle))), 0),
        ]
    )  # start in the cycle, length, substeps, further cycles back

    gain = 1.0 + recorder.gain_error
    plain_gain = not recorder.gain_error.any()
    target = kp * position + kd * velocity  # (cycles, n)
    theta_now, speed_now = x[n : 2 * n], x[3 * n : 4 * n]
    states = np.empty((cycles, len(x)))
    torques = np.empty((cycles, n))
    delayed = whole > 0 or rest > 0.0
    before = tau.copy()  # what acted before the first cycle
    advance = plant.stepper(x)
    feedback = _Feedback(sensors, cycles, n, cycle, x, seed) if sensors and sensors.feedback else None

    for k in range(cycles):
        states[k] = x
        if feedback is None:
            tau = target[k] - kp * theta_now - kd * speed_now
        else:
            seen, seen_speed = feedback(k, theta_now)
            tau = target[k] - kp * seen - kd * seen_speed
        if smooth is not None:
            tau = smooth(tau)
        torques[k] = tau
        now = k * cycle
        if not delayed and plain_gain:
            advance(tau, now, cycle, fine)
        else:
            for offset, length, count, back in parts:
                source = k - whole - back
                applied = torques[source] if source >= 0 else before
                advance(applied * gain, now + offset, length, count)
        if k % _EVERY == 0:
            if not np.isfinite(tau).all() or np.abs(tau).max() > 1e12:
                raise ConvergenceError(f"the simulation diverged at {now:.3f} s")
            if should_stop is not None and should_stop():
                raise Cancelled("the simulation was stopped")
            if progress is not None:
                progress(k / cycles)
    if progress is not None:
        progress(1.0)

    states, torques = states[::every], torques[::every]
    if not np.isfinite(states).all():
        raise ConvergenceError("the simulation diverged")
    q, theta, qv, thetav = (robot.from_pin(states[:, i * n : (i + 1) * n]) for i in range(4))
    run = Run(
        time=time[::every],
        theta=theta,
        theta_velocity=thetav,
        q=q,
        q_velocity=qv,
        tau=robot.from_pin(torques),
        tau_joint=robot.from_pin(plant.joint_torque(states)),
        theta_ref=robot.from_pin(position[::every]),
        torque_hold=cycle,
    )
    if feedback is not None:
        noise = feedback.noise[::every]
        return replace(
            run,
            theta=feedback.sensors.quantise(theta + robot.from_pin(noise)),
            tau=run.tau + robot.from_pin(feedback.torque_noise[::every]),
        )
    return run if sensors is None else run.measured(sensors, seed)


class _Feedback:
    """The position and its filtered difference as the controller sees them."""

    def __init__(
        self,
        sensors: Sensors,
        cycles: int,
        n: int,
        cycle: float,
        x: Array,
        seed: int | np.random.Generator | None,
    ) -> None:
        self.sensors = sensors
        self.noise, self.torque_noise = sensors.noise(cycles, n, seed)
        self._last = sensors.quantise(x[n : 2 * n] + self.noise[0])
        self._speed = x[3 * n : 4 * n].copy()
        self._blend = -np.expm1(-sensors.velocity_filter * cycle)
        self._cycle = cycle

    def __call__(self, k: int, theta: Array) -> tuple[Array, Array]:
        seen = self.sensors.quantise(theta + self.noise[k])
        if k:
            self._speed = self._speed + self._blend * ((seen - self._last) / self._cycle - self._speed)
        self._last = seen
        return seen, self._speed
