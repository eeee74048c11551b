"""Coupled friction."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.terms import (
    Array,
    Context,
    EffectTarget,
    ParameterSpec,
    Terms,
    neighbour,
    smooth_sign,
)


class CoupledFriction(Effect):
    name = "coupled_friction"
    title = "Coupled friction"
    where = "motor"
    plot_against = "sum of velocities"
    explanation = (
        "The motor of the next joint turns with both joints (coupled wrist gear): its friction acts on both."
    )
    equation = "u_i = u_j = f_c sign(θ̇_i + θ̇_j) + f_v (θ̇_i + θ̇_j)"
    signature = "A step, the same on both joints, where the sum of their velocities changes sign."
    confirm = "Move one of the two joints alone, then both against each other at the same speed."
    simulated = "The same u opposes motor i and motor j of the neighbouring joint."
    reference = (
        "Gautier, Janot, Vandanjon: A new closed-loop output error method for parameter identification of "
        "robot dynamics, IEEE Transactions on Control Systems Technology 21(2), 2013"
    )
    parameters = (
        ParameterSpec("coulomb", "Nm", 0.0, explanation="friction torque while moving", symbol="f_c"),
        ParameterSpec("viscous", "Nm s/rad", 0.0, explanation="friction at 1 rad/s", symbol="f_v"),
    )
    linear = True
    fewest_joints = 2
    size_at = (0, 1)
    only_among_many = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joint = place.own_joint
        pair = (joint, neighbour(joint, context.joints()))
        parts = []
        for own, other in zip(*(context.motions(j) for j in pair), strict=True):
            velocity = own.velocity + other.velocity
            parts.append(np.stack((smooth_sign(velocity), velocity)))
        slopes = np.stack([context.filtered(parts, j, 3) for j in pair], axis=-1)
        return Terms("torque", pair, np.tensordot(values, slopes, axes=1), slopes)

    def targets(self, joints: int, payloads: Iterable[str]) -> list[EffectTarget]:
        """All joints but the last one, which forms a pair with the joint before it."""
        return super().targets(joints, payloads)[:-1]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.15 * scale.torque, 0.1 * scale.torque / scale.speed)
