"""The robot's shape: one simplified mesh per rigid body, for drawing only.

Collision geometry is preferred to visual geometry; large meshes are decimated. Robots without any geometry
and links whose mesh is missing are drawn as capsules between joint frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.robot.robot import PayloadBody, Robot
from flexviz.robot.robot_files import resolve_mesh

MAX_FACES = 3000  # of a link's mesh; larger ones are decimated


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """Mesh of the rigid body that one joint moves."""

    joint: int | None  # its index; None for the base
    link: str  # reference link of the vertices
    vertices: Array  # (V, 3) in the frame of `link` [m]
    faces: NDArray[np.uint32]  # (F, 3) vertex indices


@dataclass(frozen=True, eq=False)
class RobotShape:
    """Meshes and size of a robot."""

    bodies: tuple[BodyMesh, ...]  # those that have a shape, the base first, then in the set's joint order
    tip: str  # the link whose path is drawn as a trail
    reach: float  # largest distance of a link from the base [m]
    missing: tuple[str, ...] = ()  # why meshes of the URDF are not drawn, one sentence each


def robot_shape(robot: Robot) -> RobotShape:
    """The robot's bodies from its URDF."""
    urdf = robot.description
    poses = robot.link_poses(np.zeros(robot.n))
    reach = max(float(np.linalg.norm(pose[:3, 3])) for pose in poses.values()) or 1.0
    parts: dict[int | None, list[tuple[str, Any]]] = {}
    bare = not any(link.collisions or link.visuals for link in urdf.link_map.values())
    missing: list[str] = []
    for name, link in urdf.link_map.items():
        lost = len(missing)
        mesh = None if bare else link_mesh(link, robot, missing)
        joint = robot.joint_of_link(name)
        if mesh is None:
            bare_link = bare or len(missing) > lost
            mesh = stick(robot, urdf, name, reach, poses) if bare_link or joint is not None else None
        if mesh is not None:
            parts.setdefault(joint, []).append((name, mesh))
    bodies = [
        merged(joint, parts[joint], poses) for joint in sorted(parts, key=lambda j: -1 if j is None else j)
    ]
    return RobotShape(tuple(bodies), tip_link(robot, poses), reach, tuple(dict.fromkeys(missing)))


def merged(joint: int | None, parts: list[tuple[str, Any]], poses: dict[str, Array]) -> BodyMesh:
    """The meshes of one rigid body in the frame of its first link."""
    reference = np.linalg.inv(poses[parts[0][0]])
    vertices, faces, count = [], [], 0
    for link, mesh in parts:
        relative = reference @ poses[link]
        vertices.append(np.asarray(mesh.vertices) @ relative[:3, :3].T + relative[:3, 3])
        faces.append(np.asarray(mesh.faces) + count)
        count += len(mesh.vertices)
    return BodyMesh(joint, parts[0][0], np.concatenate(vertices), np.concatenate(faces).astype(np.uint32))


def link_mesh(link: Any, robot: Robot, missing: list[str]) -> Any | None:
    """Collision geometry of a link (visual if it has none) as one mesh in the link's frame.

    The reason for each mesh that cannot be loaded is added to `missing`.
    """
    import trimesh

    meshes = []
    for element in link.collisions or link.visuals:
        try:
            mesh = geometry_mesh(element.geometry, robot)
        except InputError as error:
            missing.append(str(error))
            continue
        if mesh is not None:
            if element.origin is not None:
                mesh.apply_transform(element.origin)
            meshes.append(thinned_mesh(mesh))
    return trimesh.util.concatenate(meshes) if meshes else None


def geometry_mesh(geometry: Any, robot: Robot) -> Any | None:
    """A URDF geometry as a mesh."""
    import trimesh

    if geometry.box is not None:
        return trimesh.creation.box(extents=geometry.box.size)
    if geometry.cylinder is not None:
        return trimesh.creation.cylinder(
            radius=geometry.cylinder.radius, height=geometry.cylinder.length, sections=24
        )
    if geometry.sphere is not None:
        return trimesh.creation.icosphere(subdivisions=2, radius=geometry.sphere.radius)
    if geometry.mesh is not None:
        path = resolve_mesh(geometry.mesh.filename, robot.urdf_path)
        try:
            mesh: Any = trimesh.load(path, force="mesh")
        except Exception as error:
            raise InputError(f"mesh cannot be read ({type(error).__name__}: {error})", file=path) from None
        if geometry.mesh.scale is not None:
            mesh.apply_scale(geometry.mesh.scale)
        return mesh
    return None


def lean_shape(shape: RobotShape, faces: int) -> RobotShape:
    """The shape with at most about `faces` faces per body."""
    import trimesh

    bodies = []
    for body in shape.bodies:
        mesh = thinned_mesh(trimesh.Trimesh(body.vertices, body.faces, process=False), faces)
        thin = replace(body, vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces, np.uint32))
        bodies.append(thin)
    return replace(shape, bodies=tuple(bodies))


def thinned_mesh(mesh: Any, faces: int = MAX_FACES) -> Any:
    """The mesh with at most about `faces` faces: vertices in the same grid cell are merged."""
    import trimesh

    cells = 64
    while len(mesh.faces) > faces and cells >= 4:
        low = mesh.vertices.min(axis=0)
        size = float((mesh.vertices.max(axis=0) - low).max()) / cells or 1.0
        keys = np.floor((mesh.vertices - low) / size).astype(np.int64)
        _, index = np.unique(keys @ np.array([1, 1 << 20, 1 << 40]), return_inverse=True)
        count = index.max() + 1
        weight = np.bincount(index, minlength=count)
        centres = np.stack(
            [np.bincount(index, mesh.vertices[:, k], count) / weight for k in range(3)], axis=1
        )
        triangles = index[mesh.faces]
        triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
        if len(triangles) <= faces:
            return trimesh.Trimesh(centres, triangles, process=False)
        cells = cells * 2 // 3
    return mesh


def stick(robot: Robot, urdf: Any, link: str, reach: float, poses: dict[str, Array]) -> Any:
    """A ball at a link's frame and capsules to its child joints, for a link without geometry.

    The balls of joints that meet in a point are nested.
    """
    import trimesh

    radius, joint = 0.035 * reach, robot.joint_of_link(link)
    inner = 0.0 if joint is None else (joint + 1) / (robot.n + 1)
    own = np.linalg.inv(poses[link])
    ends = [own @ poses[joint.child] for joint in urdf.joint_map.values() if joint.parent == link]
    meshes = [trimesh.creation.icosphere(subdivisions=2, radius=(1.3 - 0.25 * inner) * radius)]
    for end in ends:
        length = float(np.linalg.norm(end[:3, 3]))
        if length < 0.1 * radius:
            continue
        capsule = trimesh.creation.capsule(height=length, radius=radius, count=(12, 12))
        capsule.apply_translation([0.0, 0.0, length / 2 - float(capsule.bounds[:, 2].mean())])
        capsule.apply_transform(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], end[:3, 3] / length))
        meshes.append(capsule)
    return trimesh.util.concatenate(meshes)


def payload_place(
    robot: Robot, shape: RobotShape, load: PayloadBody, poses: dict[str, Array]
) -> tuple[int, Array] | None:
    """Index of the body that carries a load, and the load's place (3,) in the frame of its link [m].

    None where nothing is to be drawn. `poses` are those of the links at any instant.
    """
    joint = robot.joint_of_link(load.link)
    index = next((i for i, body in enumerate(shape.bodies) if body.joint == joint), None)
    if index is None or load.mass <= 0:
        return None
    relative = np.linalg.inv(poses[shape.bodies[index].link]) @ poses[load.link]
    return index, relative[:3, :3] @ load.com + relative[:3, 3]


def tip_link(robot: Robot, poses: dict[str, Array]) -> str:
    """The link moved by the last joint of the tree that is farthest from that joint."""
    last = max(range(robot.n), key=lambda joint: int(robot.order[joint]))
    links = [link for link in robot.links if robot.joint_of_link(link) == last]
    first = poses[links[0]][:3, 3]
    return max(links, key=lambda link: float(np.linalg.norm(poses[link][:3, 3] - first)))
