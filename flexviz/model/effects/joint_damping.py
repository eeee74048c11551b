"""Joint damping."""

from __future__ import annotations

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.elastic_joint import gain, present, share_of, spring_at
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec


class JointDamping(LawEffect):
    """Damping of the transmission, parallel to its spring.

    K x + D ẋ = s is solved for the deflection x; u = s/K − x.
    """

    name = "joint_damping"
    title = "Joint damping"
    where = "joint"
    plot_against = "torque's rate"
    explanation = (
        "The gear's elasticity is damped: part of its torque is proportional to the deflection rate."
    )
    equation = "τ_j = K δ + D δ̇"
    signature = "A position error proportional to the transmitted torque's rate of change."
    confirm = "Fast motions that excite the joint's resonance."
    reference = "De Luca, Farina, Lucibello: On the control of robots with visco-elastic joints, ICRA 2005"
    parameters = (ParameterSpec("damping", "Nm s/rad", 0.0, explanation="of the deflection", symbol="D"),)
    state = True
    smooth = True
    twins = ("torque_delay",)
    damps_deflection = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        spring = spring_at(motion, present(motion, "stiffness_hardening"), values[0])
        u = gain(motion, spring) - share_of("stiffness_hardening", motion)
        return u, -spring.slope_by_damping()[None]

    def time_constant(self, values: Array, compliance: float) -> float:
        return max(float(values[0]), 0.0) * compliance

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.008 * scale.stiffness,)
