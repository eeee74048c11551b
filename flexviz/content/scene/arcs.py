"""Arcs around the joint axes whose angle is a torque or a deflection."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flexviz.base.arrays import Array
from flexviz.content.scene.shape import RobotShape
from flexviz.robot.robot import Robot

ARC_PIECES = 16  # line segments of an arc
LEAST_RADIUS, LARGEST_RADIUS = 0.1, 0.22  # of an arc, relative to the robot's reach
CLEARANCE = 1.25  # radius of an arc ÷ that of the body
ROUND = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # times a power of ten: the end of an arc
NEAR_AXIS = 0.08  # [robot's reach] along the axis: the part of the body that an arc goes around
TURN = np.linspace(0.0, math.pi, ARC_PIECES + 1)  # [rad]
SIDES = np.array([[-1.0], [1.0]])  # of an arrow


@dataclass(frozen=True, eq=False)
class JointAxis:
    """A joint axis in the frame of the link that it moves; it rotates from `across` to `along`."""

    link: str
    across: Array  # (3,) unit vectors normal to the axis
    along: Array
    radius: float  # of an arc outside the body [m]


def joint_axes(robot: Robot, shape: RobotShape) -> tuple[JointAxis | None, ...]:
    """The axis of each joint of the set; None for prismatic joints and joints without a link."""
    neutral = np.zeros(robot.n)
    poses = robot.link_poses(neutral)
    bodies = {body.joint: body.link for body in shape.bodies}
    found: list[JointAxis | None] = []
    for joint in range(robot.n):
        first = next((name for name in robot.links if robot.joint_of_link(name) == joint), None)
        link = bodies.get(joint, first)
        if link is None:
            found.append(None)
            continue
        turned = neutral.copy()
        turned[joint] = 1e-4
        rotation = poses[link][:3, :3].T @ robot.link_poses(turned)[link][:3, :3]
        axis = Rotation.from_matrix(rotation).as_rotvec()
        size = float(np.linalg.norm(axis))
        if size < 1e-8:  # prismatic
            found.append(None)
            continue
        axis /= size
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        across /= np.linalg.norm(across)
        found.append(
            JointAxis(link, across, np.cross(axis, across), _radius(shape, poses, joint, link, axis))
        )
    return tuple(found)


def _radius(shape: RobotShape, poses: dict[str, Array], joint: int, link: str, axis: Array) -> float:
    """A radius [m] outside the body of the joint where its axis leaves the link's frame."""
    thick = 0.0
    for body in shape.bodies:
        if body.joint == joint:
            relative = np.linalg.inv(poses[link]) @ poses[body.link]
            points = body.vertices @ relative[:3, :3].T + relative[:3, 3]
            along = points @ axis
            off = np.linalg.norm(points - np.outer(along, axis), axis=1)[
                np.abs(along) < NEAR_AXIS * shape.reach
            ]
            thick = float(np.median(off)) if len(off) else 0.0
    return float(np.clip(CLEARANCE * thick, LEAST_RADIUS * shape.reach, LARGEST_RADIUS * shape.reach))


def arc_arrow(axis: JointAxis, share: float, radius: float, whole: bool = True) -> NDArray[np.float32]:
    """Line segments (ARC_PIECES + 2, 2, 3) [m] of an arrow over `share` (−1 … 1) of half a turn.

    Of one that is not `whole` every second segment has no length.
    """
    share = min(max(share, -1.0), 1.0)
    unit = np.cos(share * TURN)[:, None] * axis.across + np.sin(share * TURN)[:, None] * axis.along
    direction = unit[-1] - unit[-2]
    size = math.sqrt(direction @ direction)
    head = min(0.35, 0.05 + abs(share))
    barbs = unit[-1] - head * (direction / size if size > 0 else 0.0) + 0.6 * head * SIDES * unit[-1]
    segments = np.empty((ARC_PIECES + 2, 2, 3), np.float32)
    segments[:-2, 0], segments[:-2, 1] = radius * unit[:-1], radius * unit[1:]
    if not whole:
        segments[1:-2:2, 1] = segments[1:-2:2, 0]
    segments[-2:, 0], segments[-2:, 1] = radius * unit[-1], radius * barbs
    return segments


def round_up(value: float) -> float:
    """The smallest round number that is not below `value`; 1 for zero."""
    if not value > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(digit * power for digit in ROUND if digit * power >= value * (1 - 1e-9))
