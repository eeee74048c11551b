"""Both robots in 3D: their shapes once, their motion as columns of transforms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from flexviz.charts import COLOURS, rgb
from flexviz.measurements import Group, MeasurementSet
from flexviz.recording.paths import TIME, group_path
from flexviz.recording.stream import Stream
from flexviz.robot import Robot
from flexviz.scene import RobotMotion, RobotShape

Array = NDArray[np.float64]
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


def send_robot(
    stream: Stream,
    measurements: MeasurementSet,
    shape: RobotShape,
    stage: Stage,
    group: Group,
    name: str,
    motion: RobotMotion,
    first: bool,
    result: int,
) -> None:
    """One of the two robots in one group, moved by its motor angles.

    Args:
        name: "measured" or "identified".
        first: whether its shape must be sent, too.
        result: number of the identified robot's result.
    """
    robot, theta = measurements.robot, motion.theta if name == "measured" else motion.model_theta
    if theta is None:
        return
    label = f"identified, result {result}"
    if name == "measured":
        label = "measured (simulated data)" if measurements.simulated else "measured"
    poses, place = [robot.link_poses(row) for row in theta], list(ROBOT_COLOURS).index(name)
    if first:
        offset = rr.Transform3D(translation=stage.offsets[place])
        stream.log(group_path(group.name, "robots", name), offset, static=True)
        send_shapes(stream, robot, shape, group, name, poses[0])
    index = rr.TimeColumn(TIME, duration=motion.time)
    for body in shape.bodies:
        if body.joint is not None:
            frames = np.array([pose[body.link] for pose in poses])
            columns = rr.Transform3D.columns(
                translation=frames[:, :3, 3], quaternion=quaternions(frames[:, :3, :3])
            )
            stream.send_columns(group_path(group.name, "robots", name, body.link), [index], columns)
    colour = rgb(ROBOT_COLOURS[name])
    trail = rr.LineStrips3D([[pose[shape.tip][:3, 3] for pose in poses]], colors=[colour])
    stream.log(group_path(group.name, "robots", name, "trail"), trail, static=True)
    above = rr.Points3D([[0.0, 0.0, stage.tops[place]]], labels=[label], radii=[0.0], colors=[colour])
    stream.log(group_path(group.name, "robots", name, "label"), above, static=True)


def send_shapes(
    stream: Stream, robot: Robot, shape: RobotShape, group: Group, name: str, pose: dict[str, Array]
) -> None:
    """The constant parts: meshes, base pose, payload; `pose` holds the link poses at any instant."""
    for body in shape.bodies:
        entity = group_path(group.name, "robots", name, body.link)
        mesh = rr.Mesh3D(
            vertex_positions=body.vertices.astype(np.float32),
            triangle_indices=body.faces,
            vertex_normals=trimesh.Trimesh(body.vertices, body.faces, process=False).vertex_normals,
            albedo_factor=(*rgb(ROBOT_COLOURS[name]), 255),
        )
        stream.log(entity, mesh, static=True)
        if body.joint is None:
            frame = pose[body.link]
            fixed = rr.Transform3D(translation=frame[:3, 3], mat3x3=frame[:3, :3])
            stream.log(entity, fixed, static=True)
    for number, payload in enumerate(group.bodies):
        joint = robot.joint_of_link(payload.link)
        carrier = next((body.link for body in shape.bodies if body.joint == joint), None)
        if carrier is None or payload.mass <= 0.0:
            continue
        relative = np.linalg.inv(pose[carrier]) @ pose[payload.link]
        centre = relative[:3, :3] @ payload.com + relative[:3, 3]
        ball = rr.Points3D(
            [centre],
            radii=[RADIUS_PER_KG * payload.mass ** (1 / 3)],
            colors=[(90, 90, 90)],
            labels=[f"{payload.mass:g} kg"],
            show_labels=False,
        )
        entity = group_path(group.name, "robots", name, carrier, f"payload {number + 1}")
        stream.log(entity, ball, static=True)


def quaternions(rotations: Array) -> Array:
    """Quaternions (M, 4) x y z w of rotation matrices (M, 3, 3), without sign jumps."""
    found = Rotation.from_matrix(rotations).as_quat()
    signs = np.where(np.sum(found[1:] * found[:-1], axis=1) < 0.0, -1.0, 1.0)
    found[1:] *= np.cumprod(signs)[:, None]
    return found
