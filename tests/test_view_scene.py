"""Arcs of torque and deflection, link side, the clock's end, and what a check says."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flexviz.app.playback import PlaybackClock
from flexviz.measurements import read_set
from flexviz.resources import sessions_dir
from flexviz.robot import Robot
from flexviz.scene.arcs import ARC_PIECES, arc_arrow, joint_axes, round_up
from flexviz.scene.motion import measured_motion, scene_labels, with_replay
from flexviz.scene.shape import robot_shape
from flexviz.view import joints_html
from flexviz.view.tables import MAX_NAMED, check_html
from flexviz.wording import number


def test_an_arc_turns_as_its_joint_does() -> None:
    robot = Robot.load("robots:planar_2r")
    for joint, axis in enumerate(joint_axes(robot, robot_shape(robot))):
        assert axis is not None and robot.joint_of_link(axis.link) == joint
        q = np.zeros(robot.n)
        before = robot.link_poses(q)[axis.link]
        q[joint] = 0.3
        turned = robot.link_poses(q)[axis.link][:3, :3].T @ before[:3, :3]  # the old frame seen from the new
        assert np.allclose(
            turned @ (np.cos(0.3) * axis.across + np.sin(0.3) * axis.along), axis.across, atol=1e-6
        )
        points = arc_arrow(axis, 0.5, 0.2)
        assert points.shape == (ARC_PIECES + 2, 2, 3) and np.isfinite(points).all()
        assert np.allclose(np.linalg.norm(points[:ARC_PIECES], axis=2), 0.2, atol=1e-6)
        end = points[ARC_PIECES - 1, 1] / 0.2
        assert np.arctan2(end @ axis.along, end @ axis.across) == pytest.approx(0.5 * np.pi, abs=1e-5)
        assert np.isfinite(arc_arrow(axis, 0.0, 0.2)).all()


def test_the_link_side_is_compared_with_the_link_side() -> None:
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    motion = measured_motion(measurements, measurements.groups[0], None)
    assert motion.link is not None
    measured, shown = motion.pose(1.0, 5.0, 2.0, link_side=True)
    assert np.allclose(measured, shown)
    run: Any = SimpleNamespace(time=motion.time, theta=motion.theta + 0.01, q=motion.link + 0.004, note="")
    measured, shown = with_replay(motion, run).pose(1.0, 5.0, 10.0, link_side=True)
    assert np.allclose(shown - measured, 0.04)
    first, second = scene_labels(with_replay(motion, run), 5, 10, link_side=True)
    assert "link side q" in first and "error ×10" in second


def test_half_a_turn_of_an_arc_has_a_round_value_in_the_legend() -> None:
    assert [round_up(value) for value in (0.0, 0.011, 2.0, 57.0, 801.0)] == [1.0, 0.015, 2.0, 60.0, 1000.0]
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    motion = measured_motion(measurements, measurements.groups[0], None)
    torque, deflection = motion.loads(3.0)
    assert torque is not None and deflection is not None and motion.half_turns[0] is not None
    for shares, load, ends in zip(motion.arcs(3.0), motion.loads(3.0), motion.half_turns, strict=True):
        assert shares is not None and ends is not None and load is not None
        assert np.allclose(shares * ends, load)
    assert (np.abs(motion.torque).max(axis=0) <= motion.half_turns[0]).all()  # type: ignore[arg-type]
    text = joints_html(("a", "b/c"), None, motion, 3.0)
    assert f"torque {number(torque[1], 3)} Nm" in text and 'data-node="b_c"' in text
    assert f"/ {motion.half_turns[0][0]:.0f}<" in text and f"{1e3 * deflection[0]:.1f}"[:3] in text


def test_the_clock_stands_at_the_end_without_loop() -> None:
    now = [0.0]
    clock = PlaybackClock(lambda: now[0])
    clock.span(0.0, 10.0)
    clock.loop = False
    clock.play()
    now[0] = 25.0
    assert clock.time == 10.0
    clock.play()
    assert clock.time == 0.0


def parameter(name: str, grade: str) -> Any:
    return SimpleNamespace(name=name, joint="joint1", identifiable=grade)


def test_a_check_names_what_is_weak() -> None:
    assert check_html(None) == ""
    good: Any = SimpleNamespace(
        parameters=[parameter("stiffness", "yes"), parameter("mass", "no")], combinations=()
    )
    assert "All 1 parameters" in check_html(good)
    many = [parameter("stiffness", "weak"), *[parameter("backlash.half_width", "no")] * (MAX_NAMED + 3)]
    text = check_html(SimpleNamespace(parameters=many, combinations=[parameter("x", "yes")]))  # type: ignore[arg-type]
    assert "Weak: K joint1" in text and "and 3 others" in text and "1 of 1 combinations" in text
