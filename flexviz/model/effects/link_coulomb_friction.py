"""Coulomb friction at the link."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LinearEffect
from flexviz.model.effects.terms import ARMSTRONG, SLIDING, Array, JointMotion, smooth_sign


class LinkCoulombFriction(LinearEffect):
    name = "link_coulomb_friction"
    title = "Coulomb friction at the link"
    where = "link"
    plot_against = "link velocity"
    explanation = "Dry friction in the link's bearing or seals, on the far side of the elastic gear."
    equation = "u = f_c sign(q̇)"
    signature = "A step at every reversal of the link; near reversals link and motor move differently."
    confirm = "Reversals under load with a soft joint, where link and motor reverse at different instants."
    reference = ARMSTRONG
    parameters = (SLIDING,)
    state = True
    twins = ("coulomb_friction",)
    hidden_state = True  # the reversals of the link
    common = True

    @property
    def behind_spring(self) -> bool:
        return True  # that of the motor

    def columns(self, motion: JointMotion) -> Array:
        return smooth_sign(motion.link_velocity)[np.newaxis]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * scale.torque,)
