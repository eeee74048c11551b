"""Range and speed that a joint may have."""

from __future__ import annotations

import numpy as np

from flexviz.base.arrays import Array
from flexviz.robot.robot import Robot

WIDEST = 8 * np.pi  # [rad], [m] assumed where the robot description has no limits, or wider ones
FASTEST = 40.0  # [rad/s], [m/s]
NARROWEST, SLOWEST = 0.5, 0.1  # [rad], [rad/s]: below, a description means that it has no limit


def motion_limits(robot: Robot) -> tuple[Array, Array]:
    """(n,) range [rad] and speed [rad/s] of the joints; infinite where the robot description has none."""
    width, speed = robot.upper_limit - robot.lower_limit, robot.velocity_limit
    return np.where(width > NARROWEST, width, np.inf), np.where(speed > SLOWEST, speed, np.inf)


def likely_limits(robot: Robot) -> tuple[Array, Array]:
    """`motion_limits` where the robot description has narrower ones than any robot needs."""
    width, speed = motion_limits(robot)
    return np.minimum(width, WIDEST), np.minimum(speed, FASTEST)
