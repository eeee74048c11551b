"""A goal that the servo approaches at a limited speed."""

from __future__ import annotations

from types import MappingProxyType

from flexviz.model.effects.goal_effect import GoalEffect
from flexviz.model.effects.targets import Written, not_held
from flexviz.model.effects.terms import ParameterSpec


class GoalSpeedLimit(GoalEffect):
    name = "goal_speed_limit"
    title = "Goal speed limit"
    explanation = (
        "The firmware moves towards a goal no faster than its speed limit: beyond it the joint falls behind, "
        "which looks like friction."
    )
    equation = "|ẋ| ≤ v towards θ_goal, τ = kp (x − θ)"
    confirm = "The same motion more slowly, which stays within the limit; the servo's speed register."
    simulated = "The servo follows its goal at the limited speed."
    reference = (
        "Biagiotti, Melchiorri: Trajectory Planning for Automatic Machines and Robots, Springer, 2008, "
        "chapter 4"
    )
    parameters = (ParameterSpec("speed", "rad/s", 0.0, explanation="largest speed", symbol="v"),)
    size_at = ()
    example = (1.5,)
    servo_targets = MappingProxyType({
        "mjcf": Written("slewmax of a pid actuator"),
        **not_held(
            "send goals that approach theirs at this speed at most",
            isaac="its actuators follow the goal itself; a velocity limit would limit the joint",
        ),
    })  # fmt: skip
