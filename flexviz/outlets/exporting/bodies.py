"""Distribute the inertia that a joint moves to the links of the URDF.

Only the total inertia of links fixed to each other can be identified (a hand on the last link, locked
fingers). It goes to the heaviest link, minus the CAD values of the others, which are kept. If the
difference is not physically consistent, the link takes the total and the others lose their inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.analysis.estimation import pseudo_inertia
from flexviz.base.arrays import Array
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Carrier:
    """The link that takes a joint's inertia."""

    link: str  # name
    inertia: Any  # new `pin.Inertia` in the link's frame
    rotation: Array  # (3, 3) axes of the URDF's inertia in the link's frame
    others: tuple[str, ...]  # links fixed to it
    emptied: tuple[str, ...]  # links among them that lose their inertia

    @property
    def tensor(self) -> Array:
        """(3, 3) inertia about the centre of mass in the axes `rotation` [kg m²]."""
        return self.rotation.T @ self.inertia.inertia @ self.rotation


def carriers(robot: Robot, inertial: Array) -> list[Carrier]:
    """The carriers of all joints, in the set's order; `inertial` (n, 10) as in `Robot.cad_parameters`."""
    given = link_inertias(robot)
    return [_carrier(robot, i, inertial[i], given) for i in range(robot.n)]


def _carrier(robot: Robot, i: int, whole: Array, given: dict[str, tuple[Any, Array]]) -> Carrier:
    links = [link for link in robot.links if robot.joint_of_link(link) == i]
    link = max(links, key=lambda name: given[name][0].mass if name in given else 0.0)  # the first of equals
    others = [name for name in links if name != link]
    emptied = [name for name in others if name in given]
    kept = (placement(robot, name).act(given[name][0]).toDynamicParameters() for name in emptied)
    rest = whole - sum(kept, start=np.zeros(10))
    if np.linalg.eigvalsh(pseudo_inertia(rest))[0] > 0.0:
        whole, emptied = rest, []
    own = placement(robot, link).actInv(pin.Inertia.FromDynamicParameters(whole))
    rotation = given[link][1] if link in given else np.eye(3)
    return Carrier(link, own, rotation, tuple(others), tuple(emptied))


def placement(robot: Robot, link: str) -> Any:
    """Pinocchio's placement of a link in its joint's frame."""
    return robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)].placement


def link_inertias(robot: Robot) -> dict[str, tuple[Any, Array]]:
    """Link -> its `pin.Inertia` in the URDF and the axes (3, 3) of the tensor there, for links with mass."""
    found = {}
    for name, link in robot.description.link_map.items():
        given = link.inertial
        if given is None or (given.mass or 0.0) <= 0.0:
            continue
        origin = np.eye(4) if given.origin is None else given.origin
        tensor = np.zeros((3, 3)) if given.inertia is None else given.inertia
        rotation = origin[:3, :3]
        found[name] = pin.Inertia(given.mass, origin[:3, 3], rotation @ tensor @ rotation.T), rotation
    return found
