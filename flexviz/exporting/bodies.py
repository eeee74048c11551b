"""Distribute the inertia that a joint moves to the links of the URDF.

Only the total inertia of links fixed to each other can be identified (a hand on the last link, locked
fingers). It goes to the heaviest link, minus the CAD values of the others, which are kept. If the
difference is not physically consistent, the link takes the total and the others lose their inertia.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz._pinocchio import pin
from flexviz.estimation import pseudo_inertia
from flexviz.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinkInertia:
    """A link's inertia in the form of a URDF.

    Attributes:
        mass: [kg].
        com: (3,) centre of mass in the link's frame [m].
        rotation: (3, 3) axes of `inertia` in the link's frame.
        inertia: (3, 3) about the centre of mass in those axes [kg m²].
    """

    mass: float
    com: Array
    rotation: Array
    inertia: Array

    @property
    def dynamic(self) -> Array:
        """(10,) m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link's frame."""
        along = self.rotation @ self.inertia @ self.rotation.T
        about = along + self.mass * (self.com @ self.com * np.eye(3) - np.outer(self.com, self.com))
        x, y, z = self.mass * self.com
        upper = about[0, 0], about[0, 1], about[1, 1], about[0, 2], about[1, 2], about[2, 2]
        return np.array([self.mass, x, y, z, *upper])

    @staticmethod
    def of(dynamic: Array, rotation: Array) -> LinkInertia:
        """From parameters (10,) about the link's frame, with the inertia in the axes `rotation`."""
        mass, com = float(dynamic[0]), dynamic[1:4] / dynamic[0]
        xx, xy, yy, xz, yz, zz = dynamic[4:]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        central = about - mass * (com @ com * np.eye(3) - np.outer(com, com))
        return LinkInertia(mass, com, rotation, rotation.T @ central @ rotation)


@dataclass(frozen=True, eq=False)
class Carrier:
    """The link that takes a joint's inertia.

    Attributes:
        link: name.
        inertia: new inertia.
        others: links fixed to it.
        emptied: links among them that lose their inertia.
    """

    link: str
    inertia: LinkInertia
    others: tuple[str, ...]
    emptied: tuple[str, ...]


def carriers(robot: Robot, inertial: Array) -> list[Carrier]:
    """The carriers of all joints, in the set's order; `inertial` (n, 10) as in `Robot.cad_parameters`."""
    given = link_inertias(robot.urdf)
    return [_carrier(robot, i, inertial[i], given) for i in range(robot.n)]


def _carrier(robot: Robot, i: int, whole: Array, given: dict[str, LinkInertia]) -> Carrier:
    links = [link for link in robot.links if robot.joint_of_link(link) == i]
    link = max(links, key=lambda name: given[name].mass if name in given else 0.0)  # the first of equals
    others = [name for name in links if name != link]
    rest = whole - sum((_moved(given[o].dynamic, placement(robot, o)) for o in others if o in given), start=0)
    emptied = [name for name in others if name in given]
    if _physical(rest):
        whole, emptied = rest, []
    own = _moved(whole, placement(robot, link).inverse())
    rotation = given[link].rotation if link in given else np.eye(3)
    return Carrier(link, LinkInertia.of(own, rotation), tuple(others), tuple(emptied))


def placement(robot: Robot, link: str) -> Any:
    """Pinocchio's placement of a link in its joint's frame."""
    return robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)].placement


def link_inertias(urdf: str) -> dict[str, LinkInertia]:
    """Link -> inertia in a URDF, for links with mass."""
    found = {}
    for link in ElementTree.fromstring(urdf).findall("link"):
        inertial = link.find("inertial")
        mass = None if inertial is None else inertial.find("mass")
        if inertial is None or mass is None or float(mass.get("value", 0)) <= 0.0:
            continue
        origin, tensor = inertial.find("origin"), inertial.find("inertia")
        xyz, rpy = (_numbers(None if origin is None else origin.get(key)) for key in ("xyz", "rpy"))
        xx, xy, xz, yy, yz, zz = (
            0.0 if tensor is None else float(tensor.get(key, 0))
            for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        rotation = np.array(pin.rpy.rpyToMatrix(rpy))
        found[link.get("name", "")] = LinkInertia(float(mass.get("value", 0)), xyz, rotation, matrix)
    return found


def _moved(dynamic: Array, placement: Any) -> Array:
    """Parameters (10,) about another frame; `placement` is the pose of the old frame in the new one."""
    if dynamic[0] == 0.0:
        return np.zeros(10)
    return np.array(placement.act(pin.Inertia.FromDynamicParameters(dynamic)).toDynamicParameters())


def _physical(dynamic: Array) -> bool:
    return bool(np.linalg.eigvalsh(pseudo_inertia(dynamic))[0] > 0.0)


def _numbers(text: str | None) -> Array:
    return np.array([float(part) for part in (text or "0 0 0").split()])
