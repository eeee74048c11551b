"""Transmission error."""

from __future__ import annotations

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.ripple import ORDER, PHASE, Ripple
from flexviz.model.effects.terms import ParameterSpec


class TransmissionError(Ripple):
    name = "transmission_error"
    title = "Transmission error"
    where = "joint"
    explanation = "Gear teeth are imperfect: the link's position error is periodic in the motor angle."
    equation = "δ = θ + a sin(nθ + φ) − q"
    signature = "A sine against position in the position error; in torque it grows with the speed squared."
    confirm = "The same motion at different speeds."
    reference = (
        "Gandhi, Ghorbel: Closed-loop compensation of kinematic error in harmonic drives, T-CST 10(6), 2002"
    )
    parameters = (ParameterSpec("amplitude", "rad", explanation="largest error", symbol="a"), ORDER, PHASE)

    @property
    def absorbed_by_stiffness(self) -> bool:
        return False  # it follows the position, not the torque

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (max(0.05 * scale.deflection, 3e-4), 7.0, 0.4)
