"""Stiffness hardening."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import HiddenStart, JointScale
from flexviz.model.effects.elastic_joint import gain, hardened, present, share_of, spring_at
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec

START_SHARES = (0.3, 0.6)  # of the rms torque that the cubic term carries


class StiffnessHardening(LawEffect):
    """A gear whose stiffness increases with the deflection.

    K x + k₃ x³ = s is solved for the deflection x; u = s/K − x.
    """

    name = "stiffness_hardening"
    title = "Stiffness hardening"
    where = "joint"
    plot_against = "torque"
    explanation = "The gear becomes stiffer with increasing deflection, as harmonic drives do."
    equation = "τ_j = K δ + k₃ δ³"
    signature = "A position error whose slope against load falls at high torque."
    confirm = "High loads in both directions."
    reference = (
        "Tuttle, Seering: A nonlinear model of a harmonic drive gear transmission, IEEE T-RA 12(3), 1996"
    )
    parameters = (
        ParameterSpec("cubic_stiffness", "Nm/rad³", 0.0, explanation="how much stiffer", symbol="k₃"),
    )
    state = True
    smooth = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        spring = spring_at(motion, values[0], present(motion, "joint_damping"))
        return gain(motion, spring) - share_of("joint_damping", motion), -spring.slope_by_cubic()[None]

    def softness(self, values: Array, torque: Array, compliance: float) -> Array:
        cubic, stiffness = max(float(values[0]), 0.0), 1 / compliance
        return 1 / (1 + 3 * cubic / stiffness * np.square(hardened(torque, stiffness, cubic)))

    def hidden_starts(self, torque: Array, compliance: float, rough: float) -> list[HiddenStart]:
        """Several shares of the torque for the cubic term, with a spring as stiff on average as fitted."""
        size = float(np.sqrt(np.mean(np.square(torque))))
        deflection = compliance * size
        return [
            HiddenStart((share * size / deflection**3,), compliance / (1 - share)) for share in START_SHARES
        ]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * scale.stiffness / scale.deflection**2,)
