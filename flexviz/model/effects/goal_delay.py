"""A goal that acts later than it is recorded."""

from __future__ import annotations

from types import MappingProxyType

from flexviz.model.effects.goal_effect import GoalEffect
from flexviz.model.effects.targets import NO_CONTROLLER, LeftOut, Written
from flexviz.model.effects.terms import ParameterSpec


class GoalDelay(GoalEffect):
    name = "goal_delay"
    title = "Goal delay"
    explanation = "The servo acts on a goal later than its time stamp: the bus, the driver, its own clock."
    equation = "τ = kp (θ_goal(t − d) − θ)"
    confirm = "Fast motions; steps of the goal."
    simulated = "The servo gets each goal d later than it is recorded."
    reference = "Björklund, Ljung: A review of time-delay estimation techniques, CDC 2003"
    parameters = (ParameterSpec("delay", "s", 0.0, 0.2, "how much later it acts", "d"),)
    twins = ("goal_lag",)
    example = (0.02,)
    servo_targets = MappingProxyType({
        "mjcf": Written("delay of the actuator"),
        "isaac": Written("min_delay, max_delay", missing="whole steps of the simulation"),
        "bam": Written("command_delay"),
        "urdf": LeftOut(NO_CONTROLLER, "send goals later by this time"),
    })  # fmt: skip
