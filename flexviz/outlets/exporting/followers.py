"""Mimic joints in MJCF: bodies of their own, coupled to the joints that they follow.

The identified inertia of a joint includes the locked links that follow others. Here they move, with their CAD
inertia, which is subtracted; where nothing physical would be left, they stay welded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.analysis.estimation import pseudo_inertia
from flexviz.base.arrays import Array
from flexviz.outlets.exporting.bodies import link_inertias, placement
from flexviz.robot.robot import Robot
from flexviz.robot.urdf_joints import Mimic


@dataclass(frozen=True, eq=False)
class Follower:
    """A mimic joint and what moves with it alone."""

    joint: str
    mimic: Mimic
    carrier: int  # index of the set's joint that moves it
    above: str | None  # the next follower towards the base that moves it, too
    links: tuple[str, ...]  # its own, the first with the joint's frame
    pose: Any  # `pin.SE3` of that frame in the carrier's
    inertia: Any  # `pin.Inertia` of its links in that frame
    kind: str  # "hinge" or "slide"
    axis: Array  # (3,)


@dataclass(frozen=True, eq=False)
class Followers:
    """Mimic joints that can be coupled, in the tree's order, and what is left of the joints' inertias."""

    coupled: tuple[Follower, ...]
    rest: Array  # (n, 10) inertial parameters without them
    welded: tuple[str, ...]  # why the others are not coupled, one line each

    def of(self, link: str) -> Follower | None:
        """The follower that moves a link."""
        return next((one for one in self.coupled if link in one.links), None)


def followers_of(robot: Robot, inertial: Array) -> Followers:
    """The mimic joints of a robot with these inertial parameters (n, 10), as in `Robot.cad_parameters`."""
    joints = robot.description.joint_map
    into = {joint.child: joint for joint in joints.values()}  # link -> the joint that moves it
    wanted = {name for name, mimic in robot.mimics.items() if mimic.leader in robot.joints}

    def above(link: str) -> list[str]:
        """Joints between a link and the base, the nearest first."""
        names = []
        while link in into:
            names.append(into[link].name)
            link = into[link].parent
        return names

    ways = {link: above(link) for link in robot.links}
    given = link_inertias(robot)
    found, rest, welded = list[Follower](), np.array(inertial, dtype=float), list[str]()
    for name in sorted(wanted, key=lambda name: len(ways[joints[name].child])):
        child = joints[name].child
        carrier = robot.joint_of_link(child)
        moved = [link for link in robot.links if name in ways[link]]
        own = [link for link in moved if next(j for j in ways[link] if j in wanted) == name]
        own.sort(key=lambda link: link != child)
        pose = placement(robot, child)
        parts = [placement(robot, link).act(given[link][0]) for link in own if link in given]
        total = sum((part.toDynamicParameters() for part in parts), start=np.zeros(10))
        higher = next((j for j in ways[joints[name].parent] if j in wanted), None)
        why = ""
        if carrier is None or any(robot.joint_of_link(link) != carrier for link in moved):
            why = "it carries, or is carried by, no joint of the set alone"
        elif higher is not None and all(one.joint != higher for one in found):
            why = f"{higher}, which moves it, is welded"
        elif min(np.linalg.eigvalsh(pseudo_inertia(x))[0] for x in (total, rest[carrier] - total)) <= 0.0:
            why = "its CAD inertia leaves nothing physical of the identified one"
        if why or carrier is None:
            welded.append(f"{name} ({robot.mimics[name]}): {why}; it is welded here")
            continue
        rest[carrier] -= total
        inertia = pose.actInv(sum(parts[1:], start=parts[0]))
        kind = "slide" if joints[name].type == "prismatic" else "hinge"
        more = tuple(own), pose, inertia, kind, np.asarray(joints[name].axis, dtype=float)
        found.append(Follower(name, robot.mimics[name], carrier, higher, *more))
    return Followers(tuple(found), rest, tuple(welded))
