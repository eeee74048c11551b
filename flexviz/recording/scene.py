"""Both robots in 3D: the shapes once, their motion as columns of transforms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from flexviz.charts import COLOURS, rgb
from flexviz.measurements import Group, MeasurementSet
from flexviz.recording.paths import TIME, group_path
from flexviz.recording.stream import Stream
from flexviz.robot import Robot
from flexviz.scene import RobotMotion, RobotShape

Array = NDArray[np.float64]
RADIUS_PER_KG = 0.03  # [m/kg^⅓] of the ball that shows a payload
ROBOT_COLOURS = {"measured": COLOURS.measured, "identified": COLOURS.model}
VIEW = np.array([0.42, -0.84, 0.34])  # from the robots towards the eye
POSES = 20  # of each group, from which the size of the scene is taken


@dataclass(frozen=True, eq=False)
class Stage:
    """Where the robots stand and the eye is, the same for all groups.

    Attributes
    ----------
    offsets: (2, 3) of the measured and the identified robot [m].
    tops: heights of the labels of the measured and the identified robot [m].
    centre: (3,) what the eye looks at [m].
    eye: (3,) where it is [m].
    """

    offsets: Array
    tops: tuple[float, float]
    centre: Array
    eye: Array


def set_stage(measurements: MeasurementSet, shape: RobotShape, both: bool = True) -> Stage:
    """Room for one robot, or for both side by side as the eye sees them, in all their motion."""
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
    across = np.array([-VIEW[1], VIEW[0], 0.0]) / np.hypot(VIEW[0], VIEW[1])  # the eye's right
    width = float(np.abs(across) @ (high - low)) * 1.05 + 0.05 * size
    offsets = np.outer([-0.5, 0.5], across * width) if both else np.zeros((2, 3))
    centre = (low + high) / 2
    distance = 1.35 * max(size, 2.0 * width) if both else 1.6 * size
    tops = float(high[2]) + 0.08 * size, float(high[2]) + 0.18 * size  # one above the other: names are long
    return Stage(offsets, tops, centre, centre + distance * VIEW / np.linalg.norm(VIEW))


def send_robot(
    recording: Stream,
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

    `name` is "measured" or "identified"; `first`: its shape was not sent yet, later only its motion is
    renewed; `result` is the number of the result that the identified one belongs to.
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
        recording.log(group_path(group.name, "robots", name), offset, static=True)
        send_shapes(recording, robot, shape, group, name, poses[0])
    index = rr.TimeColumn(TIME, duration=motion.time)
    for body in shape.bodies:
        if body.joint is not None:
            frames = np.array([pose[body.link] for pose in poses])
            columns = rr.Transform3D.columns(
                translation=frames[:, :3, 3], quaternion=quaternions(frames[:, :3, :3])
            )
            recording.send_columns(group_path(group.name, "robots", name, body.link), [index], columns)
    colour = rgb(ROBOT_COLOURS[name])
    trail = rr.LineStrips3D([[pose[shape.tip][:3, 3] for pose in poses]], colors=[colour])
    recording.log(group_path(group.name, "robots", name, "trail"), trail, static=True)
    above = rr.Points3D([[0.0, 0.0, stage.tops[place]]], labels=[label], radii=[0.0], colors=[colour])
    recording.log(group_path(group.name, "robots", name, "label"), above, static=True)


def send_shapes(
    recording: Stream, robot: Robot, shape: RobotShape, group: Group, name: str, pose: dict[str, Array]
) -> None:
    """What does not change: the bodies' meshes, where the base stands, the payload; `pose` is any one."""
    for body in shape.bodies:
        entity = group_path(group.name, "robots", name, body.link)
        mesh = rr.Mesh3D(
            vertex_positions=body.vertices.astype(np.float32),
            triangle_indices=body.faces,
            vertex_normals=normals(body.vertices, body.faces),
            albedo_factor=(*rgb(ROBOT_COLOURS[name]), 255),
        )
        recording.log(entity, mesh, static=True)
        if body.joint is None:
            frame = pose[body.link]
            fixed = rr.Transform3D(translation=frame[:3, 3], mat3x3=frame[:3, :3])
            recording.log(entity, fixed, static=True)
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
        recording.log(entity, ball, static=True)


def normals(vertices: Array, faces: NDArray[np.uint32]) -> NDArray[np.float32]:
    """(V, 3) area-weighted normals of the vertices."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], across)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return (total / np.where(length > 0.0, length, 1.0)).astype(np.float32)


def quaternions(rotations: Array) -> Array:
    """(M, 4) x y z w of the rotation matrices (M, 3, 3), without sign jumps from one to the next."""
    diagonal = np.stack([rotations[:, i, i] for i in range(3)], axis=1)
    x, y, z = diagonal.T
    squares = np.stack([1 + x - y - z, 1 - x + y - z, 1 - x - y + z, 1 + x + y + z], axis=1) / 4
    largest = np.argmax(squares, axis=1)
    upper = [(2, 1), (0, 2), (1, 0)]  # antisymmetric parts that belong to x, y, z
    skew = np.stack([rotations[:, i, j] - rotations[:, j, i] for i, j in upper], axis=1)
    xy, xz, yz = (rotations[:, i, j] + rotations[:, j, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    rows = [
        np.stack([4 * squares[:, 0], xy, xz, skew[:, 0]], axis=1),
        np.stack([xy, 4 * squares[:, 1], yz, skew[:, 1]], axis=1),
        np.stack([xz, yz, 4 * squares[:, 2], skew[:, 2]], axis=1),
        np.stack([skew[:, 0], skew[:, 1], skew[:, 2], 4 * squares[:, 3]], axis=1),
    ]
    chosen = np.stack(rows)[largest, np.arange(len(rotations))]
    chosen /= np.linalg.norm(chosen, axis=1, keepdims=True)
    turns = np.where(np.sum(chosen[1:] * chosen[:-1], axis=1) < 0.0, -1.0, 1.0)
    chosen[1:] *= np.cumprod(turns)[:, None]
    return chosen
