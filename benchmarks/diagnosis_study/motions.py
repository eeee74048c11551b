"""Random motions of a robot, and how hard each joint works in them."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from flexviz.model.simulation import Plan, Reference, random_fourier
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot

Array = NDArray[np.float64]

MARGIN = 0.05  # [rad] to the joint limits
FASTEST = 0.7  # share of the velocity limits
SHORTEST_RUN = 8.0  # [s] shorter groups see a part of a period


@dataclass(frozen=True, eq=False)
class PointToPoint(Reference):
    """Smooth moves between postures, all joints at once, with a pause after each.

    A move is x(u) = 10u³ − 15u⁴ + 6u⁵: velocity and acceleration are zero at its ends.

    Attributes:
        start, end: (M,) times of the moves [s].
        postures: (M + 1, n), the first one before the first move [rad].
    """

    start: Array
    end: Array
    postures: Array

    def sample(self, time: Array) -> tuple[Array, Array]:
        t = np.asarray(time, dtype=float)
        k = np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, len(self.start) - 1)
        length = (self.end - self.start)[k]
        u = np.clip((t - self.start[k]) / length, 0.0, 1.0)
        rise = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        rate = 30.0 * u**2 * (1.0 - u) ** 2 / length
        step = self.postures[k + 1] - self.postures[k]
        return self.postures[k] + rise[:, None] * step, rate[:, None] * step


def random_moves(
    robot: Robot, rng: np.random.Generator, *, centre: Array, reach: Array, duration: float
) -> PointToPoint:
    """Moves of 0.7–1.8 s between random postures within `reach` (n,) of `centre` (n,) [rad]."""
    low = np.maximum(centre - reach, robot.lower_limit + MARGIN)
    high = np.minimum(centre + reach, robot.upper_limit - MARGIN)
    start, end, postures = [0.3], [], [centre]
    while not end or end[-1] < duration:
        target = rng.uniform(low, high)
        still = rng.random(robot.n) < 0.1  # a joint may rest while the others move
        postures.append(np.where(still, postures[-1], target))
        distance = np.abs(postures[-1] - postures[-2])
        limit = np.where(robot.velocity_limit > 0, robot.velocity_limit, np.inf)
        end.append(start[-1] + max(rng.uniform(0.7, 1.8), float((1.875 * distance / limit / FASTEST).max())))
        start.append(end[-1] + rng.uniform(0.1, 0.6))
    return PointToPoint(np.array(start[:-1]), np.array(end), np.array(postures))


def random_motion(
    robot: Robot, rng: np.random.Generator, *, centre: Array, reach: Array, duration: float
) -> Reference:
    """A periodic motion or moves with pauses, as the given robots do."""
    if rng.random() < 0.5:
        return random_moves(robot, rng, centre=centre, reach=reach, duration=duration)
    period = rng.uniform(0.6, 1.0) * max(duration, SHORTEST_RUN)
    return random_fourier(
        robot,
        int(rng.integers(2**31)),
        centre=centre,
        reach=reach,
        duration=duration,
        harmonics=int(rng.integers(4, 8)),
        frequency=2 * pi / period,
        speed=FASTEST,
        margin=MARGIN,
    )


@dataclass(frozen=True, eq=False)
class Workload:
    """How hard each joint works over the groups of a plan, as if joints were rigid; (n,) each.

    Attributes:
        torque: standard deviation of the joint's torque [Nm].
        speed: rms [rad/s].
        travel: standard deviation of the position [rad].
        middle: mean position [rad].
        low, high: 15 % and 85 % quantiles of the position [rad].
        quadratic: rms of θ̇|θ̇| [rad²/s²].
    """

    torque: Array
    speed: Array
    travel: Array
    middle: Array
    low: Array
    high: Array
    quadratic: Array


def workload(plan: Plan) -> Workload:
    """The workload of a plan whose effects are not chosen yet."""
    robot, torques, positions, speeds = plan.robot, [], [], []
    viscous = plan.model.link_viscous_friction + plan.model.motor_viscous_friction
    for group in plan.groups:
        model = robot.model_with(plan.model.inertial, plan.payloads[group.payload])
        data = model.createData()
        time = np.linspace(0.0, group.duration, max(int(group.duration / 0.02), 20))
        position, velocity = group.reference.sample(time)
        acceleration = np.gradient(velocity, time, axis=0)
        rows = zip(*(robot.to_pin(x) for x in (position, velocity, acceleration)), strict=True)
        rigid = np.array([pin.rnea(model, data, *row).copy() for row in rows])
        rigid = robot.from_pin(rigid) + viscous * velocity + plan.model.motor_inertia * acceleration
        torques.append(rigid)
        positions.append(position)
        speeds.append(velocity)
    tau, theta, v = (np.concatenate(x) for x in (torques, positions, speeds))
    low, high = np.quantile(theta, (0.15, 0.85), axis=0)
    return Workload(
        torque=tau.std(axis=0) + 1e-3,
        speed=np.sqrt((v**2).mean(axis=0)) + 1e-3,
        travel=theta.std(axis=0) + 1e-3,
        middle=theta.mean(axis=0),
        low=low,
        high=high,
        quadratic=np.sqrt((v**4).mean(axis=0)) + 1e-6,
    )
