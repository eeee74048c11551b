"""Quadratic friction."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LinearEffect
from flexviz.model.effects.targets import OWN_VELOCITY, LeftOut, Written
from flexviz.model.effects.terms import ARMSTRONG, Array, JointMotion, ParameterSpec


class QuadraticFriction(LinearEffect):
    name = "quadratic_friction"
    title = "Quadratic friction"
    where = "motor"
    plot_against = "velocity"
    explanation = "Churning of lubricant or fan losses: friction grows with the square of the speed."
    equation = "u = f_q θ̇ |θ̇|"
    signature = "A parabola against velocity, with opposite signs in the two directions."
    confirm = "The same motion at clearly different speeds."
    reference = ARMSTRONG
    usual = True
    parameters = (
        ParameterSpec("quadratic", "Nm s²/rad²", 0.0, explanation="friction at 1 rad/s", symbol="f_q"),
    )
    smooth = True
    servo_targets = MappingProxyType({
        "mjcf": Written("damping, its second number"),
        "isaac": LeftOut("its joints have no quadratic friction"),
        "bam": LeftOut("BAM has no quadratic friction of the speed"),
        "urdf": LeftOut(OWN_VELOCITY),
    })  # fmt: skip

    def columns(self, motion: JointMotion) -> Array:
        return (motion.velocity * np.abs(motion.velocity))[np.newaxis]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.15 * scale.torque / scale.speed**2,)
