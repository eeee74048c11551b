"""The motion of an identified servo robot from its goals."""

from __future__ import annotations

import numpy as np

from flexviz.base.facts import Fact
from flexviz.data.measurements import Group
from flexviz.model.servo import driven_motion, free_motion, servo_values
from flexviz.model.simulation.run import Run
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import Robot

PASSES = 2  # after which the fast motion of the other joints is the model's


def replay_goals(robot: Robot, model: FlexibleModel, group: Group) -> Run:
    """Free motion of `model` from the goals of `group`, sampled at the group's own instants."""
    values, theta = servo_values(model)[:, None], None
    motion = driven_motion(robot, [group], whole=True)
    for _ in range(PASSES):
        theta = free_motion(motion, values)[0]
        motion = driven_motion(robot, [group], theta, whole=True)
    theta = free_motion(motion, values)[0]
    parts = [theta[: len(segment), :, c] for c, segment in enumerate(group.segments)]
    speeds = [np.gradient(part, s.step, axis=0) for part, s in zip(parts, group.segments, strict=True)]
    angle, speed, time = np.concatenate(parts), np.concatenate(speeds), group.joined("time")
    goal = group.at("theta_ref", time)
    assert goal is not None
    torque = values[0, 0] * group.kp_scale * (goal - angle)
    facts = (Fact("replayed", values={"loop": "goals"}),)
    return Run(time, angle, speed, angle, speed, torque, torque, goal, 0.0, facts)
