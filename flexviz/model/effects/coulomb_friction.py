"""Coulomb friction."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LinearEffect
from flexviz.model.effects.targets import Written
from flexviz.model.effects.terms import ARMSTRONG, SLIDING, Array, JointMotion, smooth_sign


class CoulombFriction(LinearEffect):
    name = "coulomb_friction"
    title = "Coulomb friction"
    where = "motor"
    plot_against = "velocity"
    explanation = "Dry friction in the motor and gear: a constant torque that always opposes the motion."
    equation = "u = f_c sign(θ̇)"
    signature = "A step at every reversal of the motor, of the same size at any speed and load."
    confirm = "Slow motions with many reversals."
    reference = ARMSTRONG
    usual = True
    parameters = (SLIDING,)
    twins = ("link_coulomb_friction",)
    common = True
    servo_targets = MappingProxyType({
        "mjcf": Written("frictionloss"),
        "isaac": Written("friction, dynamic_friction"),
        "bam": Written("friction_base"),
        "urdf": Written("friction"),
    })  # fmt: skip

    def columns(self, motion: JointMotion) -> Array:
        return smooth_sign(motion.velocity)[np.newaxis]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * scale.torque,)
