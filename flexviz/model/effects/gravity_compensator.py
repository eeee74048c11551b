"""Gravity compensator."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms


class GravityCompensator(Effect):
    name = "gravity_compensator"
    title = "Gravity compensator"
    where = "link"
    plot_against = "link position"
    explanation = (
        "A gas spring, a coil spring or a counterweight that the URDF does not contain relieves the joint of "
        "gravity."
    )
    equation = "u = a sin q + b cos q"
    signature = (
        "One sine wave per turn of the joint; it reads as wrong masses unless the masses of the CAD model "
        "are trusted."
    )
    confirm = "The same slow motion with the compensator connected and disconnected."
    reference = "Arakelian: Gravity compensation in robotics, Advanced Robotics 30(2), 79–96, 2016"
    parameters = (
        ParameterSpec("sine", "Nm", explanation="torque at q = π/2", symbol="a", above_torque=True),
        ParameterSpec("cosine", "Nm", explanation="torque at q = 0", symbol="b", above_torque=True),
    )
    linear = True
    state = True
    size_at = (0, 1)
    only_among_many = True
    instead_of = "cable_spring"
    twins = ("cable_spring", "torque_offset")

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        q = context.link_state(place.own_joint)[:1, :, None]
        slopes = np.stack((np.sin(q), np.cos(q)))
        return Terms("residual", (place.own_joint,), np.tensordot(values, slopes, axes=1), slopes)

    def refining(self, simpler: Array) -> Array:
        stiffness, rest_angle = simpler  # of a spring: k (q − q₀) near q = 0
        return np.array([stiffness, -stiffness * rest_angle])

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.33 * scale.torque, 0.33 * scale.torque)
