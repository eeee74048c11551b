"""Directional friction."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import EffectEvidence, JointScale
from flexviz.model.effects.law import LinearEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec


class DirectionalFriction(LinearEffect):
    name = "directional_friction"
    title = "Directional friction"
    where = "motor"
    plot_against = "velocity"
    explanation = "Viscous friction is larger in one direction, as in a gear worn on one flank."
    equation = "u = f_d |θ̇|"
    signature = (
        "A V against velocity: the same torque at equal speeds in both directions. Dry friction that differs "
        "between the directions is a constant instead and reads as a torque offset."
    )
    confirm = "Each stretch at several steady speeds in both directions."
    reference = (
        "Armstrong: Friction: experimental determination, modeling and compensation, "
        "IEEE International Conference on Robotics and Automation, 1988"
    )
    parameters = (
        ParameterSpec(
            "directional",
            "Nm s/rad",
            explanation="half of what viscous friction is larger forwards than backwards",
            symbol="f_d",
        ),
    )
    smooth = True
    only_among_many = True

    def columns(self, motion: JointMotion) -> Array:
        return np.abs(motion.velocity)[np.newaxis]

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """Not more than the viscous friction itself: friction of one direction would drive the motor."""
        return super().credible(values, evidence) and abs(values[0]) <= evidence.viscous

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.1 * scale.torque / scale.speed,)
