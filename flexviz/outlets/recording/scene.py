"""Both robots in 3D: their shapes once, in named frames, which their joints move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import rerun as rr
import trimesh
from scipy.spatial.transform import Rotation

from flexviz.base.arrays import Array
from flexviz.content.charts import COLOURS, rgb
from flexviz.content.scene import RobotMotion, RobotShape, measured_motion, payload_place, robot_shape
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.outlets.recording.frames import RobotFrames
from flexviz.outlets.recording.paths import TIME, path
from flexviz.outlets.recording.stream import Stream
from flexviz.robot.mounting import upright

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
        robot, stage, place = self._measurements.robot, self.stage, list(ROBOT_COLOURS).index(name)
        where, colour = partial(path, "groups", group.name, "robots", name), rgb(ROBOT_COLOURS[name])
        frames = RobotFrames(robot, f"{name}/{group.name}/")
        base, turn = rr.CoordinateFrame(frames.base), upright(robot.gravity)  # the base as it is mounted
        poses = [robot.link_poses(row) for row in theta]
        if (group.name, name) not in self._drawn:
            self._drawn.add((group.name, name))
            turned = rr.Quaternion(xyzw=Rotation.from_matrix(turn).as_quat())
            offset = stage.offsets[place]
            stand = rr.Transform3D(translation=offset, quaternion=turned, child_frame=frames.base)
            self._stream.log(where(), stand, static=True)
            frames.send_locked(self._stream, where("joints"))
            self._send_shapes(group, where, frames, colour, poses[0])
        index = rr.TimeColumn(TIME, duration=self.motion(group).time)
        frames.send_motion(self._stream, where("joints"), index, theta)
        tip = np.array([pose[self.shape.tip][:3, 3] for pose in poses])
        trail = rr.LineStrips3D([tip @ turn], colors=[colour])
        self._stream.log(where("trail"), trail, base, static=True)
        top = np.array([[0.0, 0.0, stage.tops[place]]])
        above = rr.Points3D(top @ turn, labels=[label], radii=[0.0], colors=[colour])
        self._stream.log(where("label"), above, base, static=True)

    def _send_shapes(
        self,
        group: Group,
        where: Callable[..., str],
        frames: RobotFrames,
        colour: tuple[int, int, int],
        pose: dict[str, Array],
    ) -> None:
        """Meshes and payload; `pose` holds the link poses at any instant."""
        bodies = self.shape.bodies
        for body in bodies:
            mesh = rr.Mesh3D(
                vertex_positions=body.vertices.astype(np.float32),
                triangle_indices=body.faces,
                vertex_normals=trimesh.Trimesh(body.vertices, body.faces, process=False).vertex_normals,
                albedo_factor=(*colour, 255),
            )
            self._stream.log(where(body.link), mesh, rr.CoordinateFrame(frames.of(body.link)), static=True)
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
            link = bodies[carried[0]].link
            frame = rr.CoordinateFrame(frames.of(link))
            self._stream.log(where(link, f"payload {number + 1}"), ball, frame, static=True)
