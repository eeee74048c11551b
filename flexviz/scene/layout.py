"""Where the robots stand and where the camera is, so that the motion is seen as large as possible."""

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
    """Placement for one set.

    Attributes:
        right: (3,) horizontal unit vector to the viewer's right.
        towards: (3,) unit vector from the scene to the viewer.
        centre: (3,) middle of one robot's motion [m], in its own frame.
        size: half the height of one robot's motion as it is seen [m].
        width: half its extent along `right` [m].
        depth: half its extent towards the viewer [m].
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
        """(3,) where the measured and the identified robot's bases stand [m]."""
        if layout == "Overlaid":
            return np.zeros(3), np.zeros(3)
        apart = 1.12 * self.width * self.right
        return -apart, apart

    def label_places(self, layout: str) -> tuple[Array, Array]:
        """(3,) where the measured and the identified robot's labels stand: above them, beside each other."""
        apart = (1.12 if layout != "Overlaid" else 0.62) * self.width * self.right
        above = self.centre + np.array([0.0, 0.0, 1.2 * self.size])
        return above - apart, above + apart

    def camera(self, layout: str, aspect: float = 0.75, hidden: float = 0.25) -> tuple[Array, Array]:
        """Position and point looked at (3,), so that both robots fit a canvas of width / height `aspect`.

        The lowest share `hidden` of the canvas lies under the playback panel.
        """
        half_width = self.width * (2.35 if layout != "Overlaid" else 1.15)
        half_height = 1.35 * self.size / (1.0 - hidden)  # with the labels
        half_height = max(half_height, half_width / aspect)
        distance = half_height / np.tan(FIELD_OF_VIEW / 2) + self.depth
        look = self.centre + np.array([0.0, 0.0, 0.12 * self.size - hidden * half_height])
        return look + distance * self.towards, look


def scene_layout(robot: Robot, shape: RobotShape, theta: Array) -> SceneLayout:
    """The stage for positions theta (M, n) [rad] that the robot passes."""
    points, frames = _points(robot, shape, theta[:: max(len(theta) // 60, 1)])
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2
    _, spread, axes = np.linalg.svd(frames - frames.mean(axis=0), full_matrices=False)
    normal = axes[2]
    if (
        spread[2] < 0.05 * spread[0] and abs(normal[2]) < 0.3
    ):  # a motion in a vertical plane: look at it squarely
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
    """At every position: corners of every body's box (P, 3), and the origins of all links (L, 3) [m]."""
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
