"""Placement of robots and camera such that the motion fills the view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.robot import Robot
from flexviz.scene.shape import RobotShape

Array = NDArray[np.float64]
FIELD_OF_VIEW = np.radians(50.0)  # vertical
LAYOUTS = ("Side by side", "Overlaid")


@dataclass(frozen=True, eq=False)
class SceneLayout:
    """Placement of the two robots of one measurement set.

    Attributes:
        right: (3,) horizontal unit vector to the viewer's right.
        towards: (3,) unit vector from the scene to the viewer.
        centre: (3,) middle of one robot's motion [m], in its base frame.
        size, width, depth: half extents of that motion: vertical in the view, along `right`, and towards the
            viewer [m].
        floor: height of the grid [m].
    """

    right: Array
    towards: Array
    centre: Array
    size: float
    width: float
    depth: float
    floor: float

    def offsets(self, layout: str) -> tuple[Array, Array]:
        """Base positions (3,) of the measured and the identified robot [m]."""
        if layout == "Overlaid":
            return np.zeros(3), np.zeros(3)
        apart = 1.12 * self.width * self.right
        return -apart, apart

    def label_places(self, layout: str) -> tuple[Array, Array]:
        """Label positions (3,) of the measured and the identified robot [m]: above them, side by side."""
        apart = (1.12 if layout != "Overlaid" else 0.62) * self.width * self.right
        above = self.centre + np.array([0.0, 0.0, 1.2 * self.size])
        return above - apart, above + apart

    def camera(self, layout: str, aspect: float = 0.75, hidden: float = 0.25) -> tuple[Array, Array]:
        """Camera position and target (3,) that fit both robots into a canvas of width / height `aspect`.

        The playback panel covers the lowest share `hidden` of the canvas.
        """
        half_width = self.width * (2.35 if layout != "Overlaid" else 1.15)
        half_height = 1.35 * self.size / (1.0 - hidden)  # with the labels
        half_height = max(half_height, half_width / aspect)
        distance = half_height / np.tan(FIELD_OF_VIEW / 2) + self.depth
        look = self.centre + np.array([0.0, 0.0, 0.12 * self.size - hidden * half_height])
        return look + distance * self.towards, look


def scene_layout(robot: Robot, shape: RobotShape, theta: Array) -> SceneLayout:
    """The layout for a motion through positions theta (M, n) [rad]."""
    points, frames = _points(robot, shape, theta[:: max(len(theta) // 60, 1)])
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2
    _, spread, axes = np.linalg.svd(frames - frames.mean(axis=0), full_matrices=False)
    normal = axes[2]
    in_vertical_plane = spread[2] < 0.05 * spread[0] and abs(normal[2]) < 0.3
    if in_vertical_plane:  # seen face on
        flat = np.array([normal[0], normal[1], 0.0]) / np.hypot(normal[0], normal[1])
        flat = -flat if flat[1] > 0 or (flat[1] == 0 and flat[0] < 0) else flat
        towards = 0.96 * flat + np.array([0.0, 0.0, 0.28])
    else:
        towards = np.array([0.75, -0.95, 0.5])
    towards /= np.linalg.norm(towards)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    along = (points - centre) @ right
    width = max(float(np.abs(along).max()), 0.25 * shape.reach)
    size = max(float(np.abs((points - centre) @ np.cross(towards, right)).max()), 0.3 * shape.reach)
    depth = float(np.abs((points - centre) @ towards).max())
    return SceneLayout(
        right, towards, centre, size, width, depth, float(min(0.0, low[2] - 0.02 * shape.reach))
    )


def _points(robot: Robot, shape: RobotShape, theta: Array) -> tuple[Array, Array]:
    """Corners of all bodies' bounding boxes (P, 3) and origins of all links (L, 3) over the motion [m]."""
    corners, frames = [], []
    for q in theta:
        poses = robot.link_poses(q)
        frames += [pose[:3, 3] for pose in poses.values()]
        for body in shape.bodies:
            low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
            pose = poses[body.link]
            for corner in (low, high, (low + high) / 2):
                corners.append(pose[:3, :3] @ corner + pose[:3, 3])
    return np.array(corners), np.array(frames)
