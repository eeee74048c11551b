"""Friction effects."""

import numpy as np

from flexviz.effects.base import Array, Effect, JointMotion, ParameterSpec, smooth_sign

_ARMSTRONG = (
    "Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation methods "
    "for the control of machines with friction, Automatica 30(7), 1994"
)


class CoulombFriction(Effect):
    """Dry friction between motor and gear: a constant torque against the motor's motion."""

    name = "coulomb_friction"
    title = "Coulomb friction"
    where = "motor"
    explanation = "Dry friction in the motor and gear: a constant torque that always opposes the motion."
    equation = "u = f_c sign(θ̇)"
    reference = _ARMSTRONG
    parameters = (ParameterSpec("coulomb", "Nm", lower=0.0, explanation="friction torque while moving"),)

    def columns(self, motion: JointMotion) -> Array:
        return smooth_sign(motion.velocity)[np.newaxis]


class LinkCoulombFriction(Effect):
    """Dry friction in the link's bearing, behind the elastic transmission."""

    name = "link_coulomb_friction"
    title = "Coulomb friction at the link"
    where = "link"
    explanation = "Dry friction in the link's bearing or seals, on the far side of the elastic gear."
    equation = "u = f_c sign(q̇)"
    reference = _ARMSTRONG
    parameters = (ParameterSpec("coulomb", "Nm", lower=0.0, explanation="friction torque while moving"),)

    def columns(self, motion: JointMotion) -> Array:
        return smooth_sign(motion.link_velocity)[np.newaxis]
