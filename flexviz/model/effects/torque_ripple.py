"""Torque ripple."""

from __future__ import annotations

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.ripple import ORDER, PHASE, Ripple
from flexviz.model.effects.terms import ParameterSpec


class TorqueRipple(Ripple):
    name = "torque_ripple"
    title = "Torque ripple"
    where = "motor"
    sensed = True
    explanation = "Cogging of the motor or an eccentric gear: a torque that repeats with the angle."
    equation = "u = a sin(nθ + φ)"
    signature = "A sine against position, with the same phase in both directions and at any speed."
    confirm = "Slow motion over a wide range of angles."
    reference = (
        "Holtz, Springob: Identification and compensation of torque ripple in high-precision permanent "
        "magnet motor drives, IEEE Trans. Industrial Electronics 43(2), 1996"
    )
    parameters = (ParameterSpec("amplitude", "Nm", explanation="largest torque", symbol="a"), ORDER, PHASE)

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.1 * scale.torque, 9.0, 0.7)
