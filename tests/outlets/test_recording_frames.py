"""Recorded robots: the frames that Rerun's URDF reader places are where Pinocchio has the links."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from flexviz.outlets.recording.files import Target
from flexviz.outlets.recording.frames import RobotFrames
from flexviz.outlets.recording.paths import TIME
from flexviz.outlets.recording.stream import Stream
from flexviz.robot.robot import Robot
from tests.recorded import Read, pose_of

INERTIA = """<inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>"""
LIMIT = '<limit lower="-0.1" upper="0.1" effort="1" velocity="1"/>'
# a long axis, names that need escaping, a material that Rerun refuses, joints that it cannot place
ODD = f"""<robot name="odd">
  <link name="base"/>
  <link name="first link/ü">{INERTIA}<visual><geometry><box size="1 1 1"/></geometry>
    <material name="m"><texture/></material></visual></link>
  <link name="tf#/second">{INERTIA}</link>
  <link name="finger">{INERTIA}</link>
  <link name="table">{INERTIA}</link>
  <joint name="joint one" type="revolute"><parent link="base"/><child link="first link/ü"/>
    <origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 3 4"/>{LIMIT}</joint>
  <joint name="slide" type="prismatic"><parent link="first link/ü"/><child link="tf#/second"/>
    <axis xyz="2 0 1"/>{LIMIT}</joint>
  <joint name="follower" type="revolute"><parent link="tf#/second"/><child link="finger"/>
    <origin rpy="1 0 0"/><axis xyz="0 0 2"/>{LIMIT}<mimic joint="slide" offset="0.4"/></joint>
  <joint name="free" type="planar"><parent link="finger"/><child link="table"/>
    <origin xyz="0 0.5 0"/><axis xyz="0 0 1"/></joint>
</robot>"""


def recorded(robot: Robot, theta: np.ndarray, file: Path, prefix: str = "measured/g 1/") -> Read:
    """A recording of the frames alone, at positions theta (M, n) [rad or m]."""
    stream = Stream("frames", Target(file))
    frames = RobotFrames(robot, prefix)
    frames.send_locked(stream, "/joints")
    frames.send_motion(stream, "/joints", rr.TimeColumn(TIME, duration=np.arange(len(theta))), theta)
    stream.close()
    (written,) = file.parent.glob(f"*{file.name}*")
    return Read(written)


def check(robot: Robot, tmp_path: Path) -> None:
    theta = np.random.default_rng(3).uniform(-2.0, 2.0, (5, robot.n))  # beyond many limits
    frames = recorded(robot, theta, tmp_path / "frames.rrd").frames("/joints")
    for row in range(len(theta)):
        for link, pose in robot.link_poses(theta[row]).items():
            found = pose_of(frames, f"measured/g 1/{link}", row)
            np.testing.assert_allclose(found, pose, atol=5e-6, err_msg=link)
    assert len(frames) == len(robot.links) - 1  # all but the base


@pytest.mark.parametrize("name", ["ur5", "panda", "tiago_no_hand", "icub_reduced"])
def test_frames_of_known_robots(name: str, tmp_path: Path) -> None:
    check(Robot.load(f"example-robot-data:{name}"), tmp_path)


def test_frames_of_an_odd_robot(tmp_path: Path) -> None:
    file = tmp_path / "odd.urdf"
    file.write_text(ODD, encoding="utf-8")
    robot = Robot.load(file)
    assert robot.joints == ("joint one", "slide")
    (tmp_path / "out").mkdir()
    check(robot, tmp_path / "out")
