"""A robot: its kinematic tree reduced to the joints of a measurement set, with CAD inertias and payloads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexviz.base.errors import InputError, choose_from
from flexviz.base.facts import Fact
from flexviz.base.names import names_of
from flexviz.robot._pinocchio import effort_limit, parent_joint, pin
from flexviz.robot.mounting import GRAVITY, upright
from flexviz.robot.robot_files import (
    SETTINGS,
    RobotSettings,
    find_urdf,
    is_library_robot,
    load_settings,
    read_urdf,
)
from flexviz.robot.urdf_checks import MAX_JOINTS, check_body
from flexviz.robot.urdf_inertias import inertia_facts
from flexviz.robot.urdf_joints import Mimic, locking_facts, unloaded
from flexviz.robot.urdf_units import check_units

__all__ = ["SETTINGS", "PayloadBody", "Robot", "RobotSettings", "is_library_robot", "load_settings"]


@dataclass(frozen=True, eq=False, init=False)
class PayloadBody:
    """A rigid body fixed to a link.

    Attributes:
        link: name of the URDF link it is fixed to.
        mass: [kg].
        com: (3,) its centre of mass in the link's frame [m].
        inertia: (6,) Ixx Iyy Izz Ixy Ixz Iyz about its own centre of mass, along the link's axes [kg m²].
    """

    link: str
    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def __init__(self, link: str, mass: float, com: ArrayLike, inertia: ArrayLike) -> None:
        object.__setattr__(self, "link", link)
        object.__setattr__(self, "mass", float(mass))
        for name, given, length in (("com", com, 3), ("inertia", inertia, 6)):
            value = _frozen(given)
            if value.shape != (length,):
                found = f"{name} has shape {value.shape}, expected ({length},)"
                raise InputError(f"payload body on {link}: {found}")
            object.__setattr__(self, name, value)

    @property
    def inertia_matrix(self) -> np.ndarray:
        """(3, 3) inertia about the body's own centre of mass [kg m²]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot's tree with n moving joints, in the order of the measurement set.

    Attributes:
        name: the robot's name.
        source: where it was loaded from, as written in a measurement set.
        urdf_path: the URDF file.
        joints: names of the n moving joints; every other joint stays locked at neutral.
        model: Pinocchio's model of those joints (nq == nv == n), in Pinocchio's own order, under `gravity`.
        order: (n,) Pinocchio's index of the set's joint i.
        urdf: its text, continuous joints as revolute ones with wide limits.
        lower_limit, upper_limit: (n,) position limits [rad].
        velocity_limit: (n,) [rad/s].
        effort_limit: (n,) [Nm].
        mimics: locked joint -> the joint that it follows; locked where that joint at 0 puts it.
        notes: what was odd in the description, or decided about its joints.
    """

    name: str
    source: str
    urdf_path: Path
    joints: tuple[str, ...]
    model: Any
    order: np.ndarray
    urdf: str
    lower_limit: np.ndarray
    upper_limit: np.ndarray
    velocity_limit: np.ndarray
    effort_limit: np.ndarray
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    notes: tuple[Fact, ...] = ()

    @staticmethod
    def load(
        source: str | Path, joints: str | Sequence[str] | None = None, base: Path | None = None,
        gravity: Sequence[float] = GRAVITY,
    ) -> Robot:  # fmt: skip
        """Load a URDF by path (relative to `base`), `example-robot-data:<name>` or `robots:<name>`.

        `joints` None takes every revolute, continuous and prismatic joint in tree order that moves a mass
        and follows no other joint (mimic). `gravity` (3,) [m/s²] is in the base's frame: a robot on a wall.
        """
        joints = None if joints is None else names_of(joints)
        described = read_urdf(path := find_urdf(source, base))
        mimics = described.mimics
        try:
            full = pin.buildModelFromXML(described.text)
        except (ValueError, RuntimeError) as error:
            raise InputError(f"not a usable URDF ({error})", file=path) from None
        check_units(described.root, _moving_links(full), path)
        single = [i for i in range(1, full.njoints) if full.joints[i].nq == full.joints[i].nv == 1]
        movable = [full.names[i] for i in single]
        leading = [joint for joint in movable if joint not in mimics]
        empty = unloaded(full, leading) if joints is None and leading else []
        chosen = tuple((j for j in leading if j not in empty) if joints is None else joints)
        for joint in chosen:
            if joint not in movable:
                valid = choose_from(joint, movable)
                raise InputError(f'joint "{joint}" is not a moving joint of this robot; {valid}', file=path)
            if chosen.count(joint) > 1:
                raise InputError(f'joint "{joint}" is given twice, expected once', file=path)
        if not chosen:
            raise InputError("the robot has no moving joint", file=path)
        if (count := len(chosen)) > MAX_JOINTS:
            raise InputError(
                f"{count} moving joints, expected at most {MAX_JOINTS}", file=path, place="joints"
            )
        locked = [i for i in range(1, full.njoints) if full.names[i] not in chosen]
        pose = pin.neutral(full)
        for joint in (joint for joint in mimics if joint in movable):
            pose[full.joints[full.getJointId(joint)].idx_q] = mimics[joint].offset
        model = pin.buildReducedModel(full, locked, pose) if locked else full
        model.gravity.linear = np.array(gravity, dtype=float)
        for joint in chosen:
            body = model.inertias[model.getJointId(joint)]
            check_body(joint, body.mass, body.inertia, path)
        carried = {link: model.inertias[joint] for link, joint in _moving_links(model).items()}
        notes = inertia_facts(described.root, carried, path)
        notes += locking_facts(described.root, chosen, mimics, empty, joints is not None)
        followers = {j: m for j, m in mimics.items() if j not in chosen}
        order = np.array([model.idx_vs[model.getJointId(joint)] for joint in chosen], dtype=int)
        positions = model.lowerPositionLimit, model.upperPositionLimit
        limits = (_frozen(x[order]) for x in (*positions, model.velocityLimit, effort_limit(model)))
        return Robot(
            described.name, str(source), path, chosen, model, order, described.text, *limits,
            mimics=followers, notes=(*described.notes, *notes),
        )  # fmt: skip

    @cached_property
    def gravity(self) -> tuple[float, float, float]:
        """(3,) acceleration of gravity in the base's frame [m/s²]: how the robot is mounted."""
        x, y, z = map(float, self.model.gravity.linear)
        return x, y, z

    def mounted(self, gravity: Sequence[float]) -> Robot:
        """The robot under another gravity (3,) [m/s²]."""
        model = self.model.copy()
        model.gravity.linear = np.array(gravity, dtype=float)
        return replace(self, model=model)

    @cached_property
    def prismatic(self) -> np.ndarray:
        """(n,) whether a joint slides: its position is in m, its torque a force in N."""
        kinds = [self.model.joints[1 + int(i)].shortname() for i in self.order]
        return np.array([kind.startswith("JointModelP") for kind in kinds])

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return len(self.joints)

    def to_pin(self, x: np.ndarray) -> np.ndarray:
        """x (..., n) from the set's order to Pinocchio's along the last axis; no copy when they agree."""
        return x if self._identity else x[..., self._inverse]

    def from_pin(self, x: np.ndarray) -> np.ndarray:
        """x (..., n) from Pinocchio's order to the set's along the last axis; no copy when they agree."""
        return x if self._identity else x[..., self.order]

    @cached_property
    def _identity(self) -> bool:
        return bool(np.array_equal(self.order, np.arange(self.n)))

    @cached_property
    def _inverse(self) -> np.ndarray:
        return np.argsort(self.order)

    @cached_property
    def cad_parameters(self) -> np.ndarray:
        """(n, 10) the URDF's inertias about the joint frames: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""
        rows = [self.model.inertias[1 + i].toDynamicParameters() for i in range(self.n)]
        return _frozen(np.array(rows)[self.order])

    def payload_parameters(self, bodies: Sequence[PayloadBody]) -> np.ndarray:
        """(n, 10) contribution of `bodies` to the inertial parameters, in the order of `cad_parameters`."""
        total = np.zeros((self.n, 10))
        for body in bodies:
            joint = self.joint_of_link(body.link)
            if joint is None or (body.mass == 0.0 and not body.inertia.any()):
                continue
            placement = self._link_frame(body.link).placement  # joint -> link
            centre = placement.act(body.com)  # [m] in the joint's frame
            rotated = placement.rotation @ body.inertia_matrix @ placement.rotation.T
            moved = rotated + body.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
            upper = (moved[0, 0], moved[0, 1], moved[1, 1], moved[0, 2], moved[1, 2], moved[2, 2])
            total[joint] += np.concatenate(([body.mass], body.mass * centre, upper))
        return total

    def model_with(
        self,
        parameters: np.ndarray,
        payload: Sequence[PayloadBody] = (),
        gravity: Sequence[float] | None = None,
    ) -> Any:
        """A copy of the model with inertias `parameters` (n, 10) + payload.

        `gravity` (3,) [m/s²] in the base's frame; None: the robot's own.
        """
        values = np.asarray(parameters, dtype=float) + self.payload_parameters(payload)
        model = self.model.copy()
        for i, row in enumerate(values):
            if row[0] == 0.0 and row.any():
                name = self.joints[i]
                raise InputError(f"joint {name}: a body without mass cannot have moments or inertia")
            inertia = pin.Inertia.FromDynamicParameters(row) if row[0] else pin.Inertia.Zero()
            model.inertias[1 + int(self.order[i])] = inertia
        if gravity is not None:
            model.gravity.linear = np.asarray(gravity, dtype=float)
        return model

    def cad_torques(
        self, bodies: Sequence[PayloadBody], q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> np.ndarray:
        """(M, n) rigid inverse dynamics of the CAD model with `bodies` along q, v, a (M, n) [Nm]."""
        model = self.model_with(self.cad_parameters, bodies)
        data = model.createData()
        state = [self.to_pin(x) for x in (q, v, a)]
        return self.from_pin(np.array([pin.rnea(model, data, *row) for row in zip(*state, strict=True)]))

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Names of all links."""
        return tuple(self._link_index)

    def joint_of_link(self, link: str) -> int | None:
        """Index of the set's joint that moves `link`, or None when it is fixed to the base."""
        parent = parent_joint(self._link_frame(link))
        return None if parent == 0 else int(np.flatnonzero(self.order == self.model.idx_vs[parent])[0])

    def link_poses(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Pose (4, 4) of every link at the joint positions q (n,) [rad], with the base as it is mounted.

        In the frame that has z up and the base at its origin; of an upright robot that is the base's own.
        """
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, self.to_pin(np.asarray(q, dtype=float)))
        return {name: (self._base * data.oMf[i]).homogeneous for name, i in self._link_index.items()}

    @cached_property
    def _base(self) -> Any:
        return pin.SE3(upright(self.gravity), np.zeros(3))

    def _link_frame(self, link: str) -> Any:
        if link not in self._link_index:
            valid = choose_from(link, self.links)
            raise InputError(f'link "{link}" does not exist; {valid}', file=self.urdf_path)
        return self.model.frames[self._link_index[link]]

    @cached_property
    def _link_index(self) -> dict[str, int]:
        return {f.name: i for i, f in enumerate(self.model.frames) if f.type == pin.FrameType.BODY}

    @cached_property
    def description(self) -> Any:
        """The URDF as `yourdfpy.URDF`, without meshes."""
        import io

        import yourdfpy

        return yourdfpy.URDF.load(
            io.BytesIO(self.urdf.encode()),
            build_scene_graph=False,
            load_meshes=False,
            build_collision_scene_graph=False,
        )


def _moving_links(model: Any) -> dict[str, int]:
    """Links that a joint of the model moves -> Pinocchio's index of the joint."""
    bodies = (f for f in model.frames if f.type == pin.FrameType.BODY)
    return {f.name: joint for f in bodies if (joint := parent_joint(f)) > 0}


def _frozen(x: ArrayLike) -> np.ndarray:
    array = np.array(x, dtype=float)
    array.setflags(write=False)
    return array
