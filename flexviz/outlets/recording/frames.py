"""The named frames of a robot, one per link, which Rerun's own URDF reader places.

Only the joints are left to it. The bodies are flexviz' own meshes in these frames: Rerun finds `package://`
meshes by environment variables alone, draws nothing for a robot without meshes, and stores every file whole:
6.9 MB of a UR5 and 10.7 MB of a Panda, per robot and group, instead of 0.14 and 0.07 MB.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from flexviz.base.arrays import Array
from flexviz.outlets.recording.paths import path
from flexviz.outlets.recording.stream import Stream
from flexviz.robot.robot import Robot

JOINT_PARTS = ("parent", "child", "origin", "axis")
PLACED = ("revolute", "continuous", "prismatic")  # joints whose transforms Rerun computes from a position


class RobotFrames:
    """The frames of one robot: `prefix`<link>.

    Attributes:
        base: the frame of its root link.
    """

    def __init__(self, robot: Robot, prefix: str) -> None:
        self._robot = robot
        self._prefix = prefix
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "robot.urdf"
            file.write_text(skeleton(robot.urdf), encoding="utf-8")
            self._tree = UrdfTree.from_file_path(file, frame_prefix=prefix)
        self.base = self.of(self._tree.root_link().name)

    def of(self, link: str) -> str:
        """The frame of a link."""
        return self._prefix + link

    def send_locked(self, stream: Stream, where: str) -> None:
        """The joints that do not move, for all times: entities `where`/<joint>."""
        for joint in self._tree.joints():
            if joint.name not in self._robot.joints:
                mimic = self._robot.mimics.get(joint.name)
                placed = joint.compute_transform(mimic.offset if mimic else 0.0, clamp=False)
                stream.log(where + path(joint.name), placed, static=True)

    def send_motion(self, stream: Stream, where: str, index: rr.TimeColumn, theta: Array) -> None:
        """The moving joints at positions theta (M, n) [rad or m], beyond their limits too."""
        for number, name in enumerate(self._robot.joints):
            joint = self._tree.get_joint_by_name(name)
            assert joint is not None  # the tree is the robot's
            columns = joint.compute_transform_columns(theta[:, number].tolist(), clamp=False)
            stream.send_columns(where + path(name), [index], columns)


def skeleton(urdf: str) -> str:
    """The links and joints of a URDF alone, in the form that Rerun reads as Pinocchio does.

    Rerun refuses materials that Pinocchio ignores, multiplies positions by the length of an axis, and places
    no planar or floating joint; those are locked, so here they are fixed.
    """
    root = ElementTree.fromstring(urdf)
    plain = Element("robot", name=root.get("name") or "robot")
    for link in root.findall("link"):
        SubElement(plain, "link", name=link.get("name", ""))
    for joint in root.findall("joint"):
        kind = joint.get("type", "")
        kept = SubElement(
            plain, "joint", name=joint.get("name", ""), type=kind if kind in PLACED else "fixed"
        )
        kept.extend(part for part in joint if part.tag in JOINT_PARTS)
        for axis in kept.findall("axis"):
            vector = np.array(axis.get("xyz", "1 0 0").split(), dtype=float)
            axis.set("xyz", " ".join(f"{x!r}" for x in (vector / (np.linalg.norm(vector) or 1.0)).tolist()))
    return ElementTree.tostring(plain, encoding="unicode")
