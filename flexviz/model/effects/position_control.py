"""The gain of a servo that follows goals."""

from __future__ import annotations

from types import MappingProxyType

from flexviz.model.effects.goal_effect import GoalEffect
from flexviz.model.effects.targets import NO_CONTROLLER, LeftOut, Written
from flexviz.model.effects.terms import ParameterSpec


class PositionControl(GoalEffect):
    name = "position_control"
    title = "Position control"
    explanation = "The servo makes a torque in proportion to how far the joint is from its goal."
    equation = "τ = kp (θ_goal − θ)"
    confirm = "A known mass: it gives the gain its scale."
    simulated = "A torque kp (θ_goal − θ), at every step of the servo's own clock."
    reference = "Åström, Murray: Feedback Systems, Princeton University Press, 2008, chapter 11"
    parameters = (ParameterSpec("gain", "Nm/rad", 0.0, explanation="torque per angle", symbol="kp"),)
    example = (14.0,)
    servo_targets = MappingProxyType({
        "mjcf": Written("kp of the actuator"),
        "isaac": Written("stiffness"),
        "bam": LeftOut(
            "BAM makes the gain of the motor: kp · error_gain · vin · kt / R",
            "choose these so that their product is the gain",
        ),
        "urdf": LeftOut(NO_CONTROLLER, "set it in the controller"),
    })  # fmt: skip
