"""A goal that is smoothed before the servo follows it."""

from __future__ import annotations

from types import MappingProxyType

from flexviz.model.effects.goal_effect import GoalEffect
from flexviz.model.effects.targets import Written, not_held
from flexviz.model.effects.terms import ParameterSpec


class GoalLag(GoalEffect):
    name = "goal_lag"
    title = "Goal low-pass"
    explanation = "The servo smooths its goal by a low-pass before it follows it."
    equation = "T ẋ = θ_goal − x, τ = kp (x − θ)"
    confirm = "Steps of the goal, small and large: the answer to both has the same shape."
    simulated = "The servo follows its goal through a first-order low-pass."
    reference = "Åström, Murray: Feedback Systems, Princeton University Press, 2008, chapter 12"
    parameters = (ParameterSpec("time_constant", "s", 0.0, 1.0, "of the low-pass", "T"),)
    twins = ("goal_delay",)
    example = (0.03,)
    servo_targets = MappingProxyType({
        "mjcf": Written("timeconst of the actuator"),
        **not_held(
            "send goals through a first-order low-pass of this time constant",
            isaac="its actuators follow the goal itself",
        ),
    })  # fmt: skip
