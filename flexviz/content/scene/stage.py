"""The stage: where the robots and their labels stand, and from where they are seen."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from flexviz.base.arrays import Array
from flexviz.content.scene.framing import Screen, framing
from flexviz.content.scene.shape import RobotShape
from flexviz.robot.robot import Robot

LAYOUTS = SIDE_BY_SIDE, OVERLAID = ("Side by side", "Overlaid")
VIEWS = ("Front", "Oblique", "Above")  # of the camera
APART = 2.24  # between the bases of neighbouring robots, relative to the width of the motion
LABEL_APART = 1.45  # between the labels of overlaid robots, likewise
LABEL_HEIGHT = 60.0  # [pixels] four lines under a robot
USUAL = Screen(520.0, 800.0)  # where the browser has not told its own yet
UP = np.array([0.0, 0.0, 1.0])
PLANAR = 0.05  # depth of a planar motion, relative to its length
INSTANTS = 60  # of the motion whose bounding boxes are looked at


@dataclass(frozen=True, eq=False)
class SceneLayout:
    """Placement of the robots of one measurement set: the measured one is always on the viewer's left."""

    towards: Array  # (3,) unit vector from the scene to the viewer
    right: Array  # (3,) horizontal unit vector to the viewer's right
    points: (
        Array  # (P, 3) corners of all bodies' bounding boxes over the motion of one robot [m], in its base
    )
    width: float  # half extent of the motion along `right` [m]
    size: float  # half extent of the motion as it is seen, vertically [m]
    floor: float  # height of the grid [m]

    @property
    def centre(self) -> Array:
        """Middle of one robot's motion (3,) [m], in its base frame."""
        return (self.points.min(axis=0) + self.points.max(axis=0)) / 2

    @property
    def axes(self) -> Array:
        """Unit vectors to the viewer's right, up and towards the viewer, shape (3, 3)."""
        return np.stack((self.right, np.cross(self.towards, self.right), self.towards))

    def offsets(self, layout: str, count: int = 2) -> tuple[Array, ...]:
        """Base positions (3,) of `count` robots, left to right [m]."""
        return self._row(0.0 if layout == OVERLAID else APART, count)

    def label_places(self, layout: str, count: int = 2) -> tuple[Array, ...]:
        """Label positions (3,) of the robots [m]: under their motions."""
        below = (self.centre @ self.right) * self.right + (self.floor - 0.02 * self.size) * UP
        row = self._row(LABEL_APART if layout == OVERLAID else APART, count)
        return tuple(below + place for place in row)

    def _row(self, apart: float, count: int) -> tuple[Array, ...]:
        middle = (count - 1) / 2
        return tuple((number - middle) * apart * self.width * self.right for number in range(count))

    def direction(self, view: str) -> Array:
        """From the scene to the viewer (3,), for one of VIEWS."""
        turns = {"Oblique": self.towards + 0.8 * self.right + 0.4 * UP, "Above": 0.25 * self.towards + UP}
        return turns.get(view, self.towards)

    def camera(
        self, layout: str, towards: Array, count: int = 2, screen: Screen = USUAL
    ) -> tuple[Array, Array]:
        """Camera position and target (3,) [m] that fit `count` robots, over their whole motion, and their
        labels into the free part of a screen, seen from the direction `towards` (3,)."""
        robots = [self.points + place for place in self.offsets(layout, count)]
        points = np.concatenate([*robots, self.label_places(layout, count)])
        tilted = towards + 1e-3 * np.linalg.norm(towards) * self.towards  # defined also straight from above
        return framing(points, tilted, screen, LABEL_HEIGHT)


def scene_layout(robot: Robot, shape: RobotShape, theta: Array) -> SceneLayout:
    """The layout for a motion through positions theta (M, n) [rad]; a planar motion is seen face on."""
    points, frames = _points(robot, shape, theta[:: max(len(theta) // INSTANTS, 1)])
    _, spread, axes = np.linalg.svd(frames - frames.mean(axis=0), full_matrices=False)
    normal = axes[2]
    planar = spread[2] < PLANAR * spread[0]
    if planar and abs(normal[2]) < 0.3:  # in a vertical plane
        flat = normal * [1.0, 1.0, 0.0] / np.hypot(normal[0], normal[1])
        flat = -flat if flat[1] > 0 or (flat[1] == 0 and flat[0] < 0) else flat
        towards = 0.96 * flat + 0.28 * UP
    elif planar and abs(normal[2]) > 0.95:  # in a horizontal plane
        towards = np.array([0.0, -0.28, 0.96])
    else:
        towards = np.array([0.75, -0.95, 0.5])
    towards /= np.linalg.norm(towards)
    right = np.cross(UP, towards)
    right /= np.linalg.norm(right)
    low, high = points.min(axis=0), points.max(axis=0)
    seen = points - (low + high) / 2
    width = max(float(np.abs(seen @ right).max()), 0.25 * shape.reach)
    size = max(float(np.abs(seen @ np.cross(towards, right)).max()), 0.3 * shape.reach)
    return SceneLayout(towards, right, points, width, size, float(min(0.0, low[2] - 0.02 * shape.reach)))


def _points(robot: Robot, shape: RobotShape, theta: Array) -> tuple[Array, Array]:
    """Corners of all bodies' bounding boxes (P, 3) and origins of all links (L, 3) over the motion [m]."""
    boxes = {body.link: _corners(body.vertices) for body in shape.bodies}
    corners, frames = [], []
    for q in theta:
        poses = robot.link_poses(q)
        frames += [pose[:3, 3] for pose in poses.values()]
        corners += [boxes[link] @ poses[link][:3, :3].T + poses[link][:3, 3] for link in boxes]
    return np.concatenate(corners), np.array(frames)


def _corners(vertices: Array) -> Array:
    """Corners (8, 3) of the bounding box of vertices (V, 3)."""
    return np.array(list(product(*zip(vertices.min(axis=0), vertices.max(axis=0), strict=True))))
