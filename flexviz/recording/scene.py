"""Both robots in 3D: their shapes once, their motion as columns of transforms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import rerun as rr
import trimesh
from scipy.spatial.transform import Rotation

from flexviz.arrays import Array
from flexviz.charts import COLOURS, rgb
from flexviz.measurements import Group, MeasurementSet
from flexviz.recording.paths import TIME, path
from flexviz.recording.stream import Stream
from flexviz.scene import RobotMotion, RobotShape, measured_motion, payload_place, robot_shape

RADIUS_PER_KG = 0.03  # [m/kg^⅓] of the ball that shows a payload
ROBOT_COLOURS = {"measured": COLOURS.measured, "identified": COLOURS.model}
VIEW = np.array([0.42, -0.84, 0.34])  # direction from the robots to the camera
POSES = 20  # per segment, for the size of the scene


@dataclass(frozen=True, eq=False)
class Stage:
    """Placement of the robots and the camera, the same for all groups.

    Attributes:
        offsets: (2, 3) of the measured and the identified robot [m].
        tops: heights of the labels of the measured and the identified robot [m].
        centre: (3,) point the camera looks at [m].
        eye: (3,) camera position [m].
    """

    offsets: Array
    tops: tuple[float, float]
    centre: Array
    eye: Array


def set_stage(measurements: MeasurementSet, shape: RobotShape, both: bool = True) -> Stage:
    """A stage for one robot in all its motion, or for both side by side in the camera's view."""
    robot = measurements.robot
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for group in measurements.groups:
        for segment in group.segments:
            for row in segment.theta[:: max(1, len(segment) // POSES)]:
                poses = robot.link_poses(row)
                for body in shape.bodies:
                    pose = poses[body.link]
                    points = body.vertices @ pose[:3, :3].T + pose[:3, 3]
                    low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    if not np.isfinite(low).all():
        low, high = np.full(3, -shape.reach), np.full(3, shape.reach)
    size = float(np.linalg.norm(high - low))
    across = np.array([-VIEW[1], VIEW[0], 0.0]) / np.hypot(VIEW[0], VIEW[1])  # to the camera's right
    width = float(np.abs(across) @ (high - low)) * 1.05 + 0.05 * size
    offsets = np.outer([-0.5, 0.5], across * width) if both else np.zeros((2, 3))
    centre = (low + high) / 2
    distance = 1.35 * max(size, 2.0 * width) if both else 1.6 * size
    tops = float(high[2]) + 0.08 * size, float(high[2]) + 0.18 * size  # staggered: labels are long
    return Stage(offsets, tops, centre, centre + distance * VIEW / np.linalg.norm(VIEW))


class RobotScene:
    """Both robots in every group: the measured one, and the identified one beside it.

    Attributes:
        shape: of the robot.
        stage: where the robots and the camera are.
    """

    def __init__(self, stream: Stream, measurements: MeasurementSet, both: bool) -> None:
        self._stream = stream
        self._measurements = measurements
        self._both = both
        self._motions: dict[str, RobotMotion] = {}
        self._drawn: set[tuple[str, str]] = set()  # (group, robot) whose shape was sent

    @cached_property
    def shape(self) -> RobotShape:
        return robot_shape(self._measurements.robot)

    @cached_property
    def stage(self) -> Stage:
        return set_stage(self._measurements, self.shape, self._both)

    def motion(self, group: Group) -> RobotMotion:
        """The measured motion of a group."""
        if group.name not in self._motions:
            self._motions[group.name] = measured_motion(self._measurements, group, None)
        return self._motions[group.name]

    def send(self, group: Group, name: str, theta: Array | None, label: str) -> None:
        """The robot "measured" or "identified" in a group, moved by its motor angles (N, n) [rad]."""
        if theta is None:
            return
        robot, shape, stage = self._measurements.robot, self.shape, self.stage
        poses, place = [robot.link_poses(row) for row in theta], list(ROBOT_COLOURS).index(name)
        where, colour = partial(path, "groups", group.name, "robots", name), rgb(ROBOT_COLOURS[name])
        if (group.name, name) not in self._drawn:
            self._drawn.add((group.name, name))
            self._stream.log(where(), rr.Transform3D(translation=stage.offsets[place]), static=True)
            self._send_shapes(group, where, colour, poses[0])
        index = rr.TimeColumn(TIME, duration=self.motion(group).time)
        for body in shape.bodies:
            if body.joint is not None:
                frames = np.array([pose[body.link] for pose in poses])
                columns = rr.Transform3D.columns(
                    translation=frames[:, :3, 3], quaternion=quaternions(frames[:, :3, :3])
                )
                self._stream.send_columns(where(body.link), [index], columns)
        trail = rr.LineStrips3D([[pose[shape.tip][:3, 3] for pose in poses]], colors=[colour])
        self._stream.log(where("trail"), trail, static=True)
        above = rr.Points3D([[0.0, 0.0, stage.tops[place]]], labels=[label], radii=[0.0], colors=[colour])
        self._stream.log(where("label"), above, static=True)

    def _send_shapes(
        self, group: Group, where: Callable[..., str], colour: tuple[int, int, int], pose: dict[str, Array]
    ) -> None:
        """The constant parts: meshes, base pose, payload; `pose` holds the link poses at any instant."""
        bodies = self.shape.bodies
        for body in bodies:
            mesh = rr.Mesh3D(
                vertex_positions=body.vertices.astype(np.float32),
                triangle_indices=body.faces,
                vertex_normals=trimesh.Trimesh(body.vertices, body.faces, process=False).vertex_normals,
                albedo_factor=(*colour, 255),
            )
            self._stream.log(where(body.link), mesh, static=True)
            if body.joint is None:
                frame = pose[body.link]
                fixed = rr.Transform3D(translation=frame[:3, 3], mat3x3=frame[:3, :3])
                self._stream.log(where(body.link), fixed, static=True)
        for number, payload in enumerate(group.bodies):
            carried = payload_place(self._measurements.robot, self.shape, payload, pose)
            if carried is None:
                continue
            ball = rr.Points3D(
                [carried[1]],
                radii=[RADIUS_PER_KG * payload.mass ** (1 / 3)],
                colors=[(90, 90, 90)],
                labels=[f"{payload.mass:g} kg"],
                show_labels=False,
            )
            self._stream.log(where(bodies[carried[0]].link, f"payload {number + 1}"), ball, static=True)


def quaternions(rotations: Array) -> Array:
    """Quaternions (M, 4) x y z w of rotation matrices (M, 3, 3), without sign jumps."""
    found = Rotation.from_matrix(rotations).as_quat()
    signs = np.where(np.sum(found[1:] * found[:-1], axis=1) < 0.0, -1.0, 1.0)
    found[1:] *= np.cumprod(signs)[:, None]
    return found
