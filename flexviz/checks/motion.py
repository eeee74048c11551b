"""The motion of a recording at a few instants, and what its joints can do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.thresholds import LIMITS
from flexviz.data.measurements import bridge
from flexviz.robot.robot import Robot

WINDOW = 0.05  # [s] half width of the local parabolas that give velocity and acceleration
INSTANTS = 200  # of a group


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """Positions, velocities, accelerations, torques and their rates at a few instants, all (M, n)."""

    q: Array
    v: Array
    a: Array
    torque: Array
    rate: Array


def sample_motion(time: Array, theta: Array, tau: Array) -> SampledMotion:
    """The motion at up to `INSTANTS` instants: local parabolas through θ, lines through τ, (N, n)."""
    bridged = bridge(time, np.hstack([theta, tau]))
    time, theta, tau = bridged.time, *np.hsplit(bridged.signals, 2)
    count = len(time)
    step = float(np.median(np.diff(time)))
    half = int(np.clip(round(WINDOW / step), 3, max(3, count // 20)))
    centres = np.linspace(half, count - 1 - half, min(INSTANTS, count - 2 * half)).astype(int)
    offsets = np.arange(-half, half + 1)
    # a gap inside the window would be taken for a fast motion
    regular = time[centres + half] - time[centres - half] < 2.5 * half * step
    centres = centres[regular] if regular.any() else centres
    x = offsets / half
    parabola = np.linalg.pinv(np.stack([np.ones_like(x), x, x**2 / 2], axis=1))  # (3, 2 half + 1)
    rows = centres[:, None] + offsets
    width = half * step  # [s]
    q, v, a = np.einsum("kw,mwn->kmn", parabola, theta[rows])
    rate = np.einsum("w,mwn->mn", parabola[1], tau[rows])
    return SampledMotion(q, v / width, a / width**2, np.mean(tau[rows], axis=1), rate / width)


def wrong_time_unit(step: float, speed: float) -> str | None:
    """The unit that a time with this median step seems to be in; None where it can be seconds.

    Args:
        step: as if it were in seconds.
        speed: largest joint speed that it implies [rad/s].
    """
    if step > LIMITS.slowest_step or (step > LIMITS.slow_step and speed < LIMITS.resting_speed):
        return "milliseconds" if step < 100 else "microseconds" if step < 1e5 else "nanoseconds"
    return None


def motion_limits(robot: Robot) -> tuple[Array, Array]:
    """(n,) range [rad] and speed [rad/s] of the joints; infinite where the robot description has none."""
    width, speed = robot.upper_limit - robot.lower_limit, robot.velocity_limit
    return np.where(width > 0.5, width, np.inf), np.where(speed > 0.1, speed, np.inf)


def likely_limits(robot: Robot) -> tuple[Array, Array]:
    """`motion_limits` where the robot description has narrower ones than any robot needs."""
    width, speed = motion_limits(robot)
    return np.minimum(width, LIMITS.widest), np.minimum(speed, LIMITS.fastest)
