"""Torque arrows: an arc around each joint axis whose angle is proportional to the torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flexviz.robot import Robot

Array = NDArray[np.float64]
ARC_PIECES = 16  # line segments of an arc
ARC_ANGLE = 1.6 * np.pi  # [rad] for the largest torque
ARROW_RADIUS = 0.16  # relative to the robot's reach


@dataclass(frozen=True, eq=False)
class TorqueAxis:
    """A joint axis in the frame of the link that it moves.

    Attributes:
        link: the link whose frame is used.
        across, along: (3,) unit vectors normal to the axis; the joint rotates from `across` to `along`.
    """

    link: str
    across: Array
    along: Array


def torque_axes(robot: Robot) -> tuple[TorqueAxis | None, ...]:
    """The axis of each joint of the set; None for prismatic joints and joints without a link."""
    neutral = np.zeros(robot.n)
    poses = robot.link_poses(neutral)
    found: list[TorqueAxis | None] = []
    for joint in range(robot.n):
        link = next((name for name in robot.links if robot.joint_of_link(name) == joint), None)
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
        found.append(TorqueAxis(link, across, np.cross(axis, across)))
    return tuple(found)


def torque_arrow(axis: TorqueAxis, share: float, radius: float) -> NDArray[np.float32]:
    """Line segments (ARC_PIECES + 2, 2, 3) [m] of an arrow over `share` (−1 … 1) of the largest angle."""
    share = float(np.clip(share, -1.0, 1.0))
    angle = np.linspace(0.0, share * ARC_ANGLE, ARC_PIECES + 1)
    points = radius * (np.outer(np.cos(angle), axis.across) + np.outer(np.sin(angle), axis.along))
    tip, direction = points[-1], points[-1] - points[-2]
    size = float(np.linalg.norm(direction))
    direction = direction / size if size > 0 else np.zeros(3)
    outward = points[-1] / radius
    head = min(0.35, 0.05 + abs(share)) * radius
    barbs = [tip - head * direction + 0.6 * side * head * outward for side in (-1.0, 1.0)]
    segments = [*np.stack([points[:-1], points[1:]], axis=1), *(np.stack([tip, barb]) for barb in barbs)]
    return np.asarray(segments, dtype=np.float32)
