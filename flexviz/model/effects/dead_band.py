"""Small distances from the goal to which the servo does not answer."""

from __future__ import annotations

from types import MappingProxyType

from flexviz.model.effects.goal_effect import GoalEffect
from flexviz.model.effects.targets import STEPPED, LeftOut, not_held
from flexviz.model.effects.terms import ParameterSpec


class DeadBand(GoalEffect):
    name = "dead_band"
    title = "Dead band of the servo"
    explanation = "Within a small distance from the goal the servo makes no torque."
    equation = "τ = kp dead(θ_goal − θ, δ)"
    confirm = "Slow motions and small steps of the goal."
    simulated = "No torque within ±δ of the goal; beyond, it begins at zero."
    reference = "Slotine, Li: Applied Nonlinear Control, Prentice Hall, 1991, chapter 5"
    parameters = (ParameterSpec("half_width", "rad", 0.0, 0.5, "half of the band", "δ"),)
    twins = ("coulomb_friction",)
    example = (0.005,)
    servo_targets = MappingProxyType({
        "mjcf": LeftOut("MuJoCo's actuators have no dead band", STEPPED),
        **not_held(
            "send goals that are nearer to the joint by the half width, or its own position",
            isaac="its actuators have no dead band",
        ),
    })  # fmt: skip
