"""Motor coupling."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms, neighbour


class MotorCoupling(Effect):
    name = "motor_coupling"
    title = "Motor coupling"
    where = "motor"
    plot_against = "neighbour's acceleration"
    explanation = (
        "The neighbouring motor's rotor accelerates this joint too: their axes share a gear or a housing."
    )
    equation = "u_i = B_ij θ̈_j"
    signature = "A residual proportional to the neighbouring motor's acceleration."
    confirm = "Move the neighbouring joint alone."
    simulated = "B_ij θ̈_j opposes motor i."
    reference = "Murphy, Wen, Saridis: Simulation and analysis of flexibly jointed manipulators, CDC 1990"
    parameters = (ParameterSpec("inertia", "kg m²", explanation="coupled rotor inertia", symbol="B_ij"),)
    linear = True
    twins = ("motor_coupling",)  # on the neighbour with the opposite sign: they differ by an inertia of links
    fewest_joints = 2

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joint = place.own_joint
        column = context.theta(neighbour(joint, context.joints()))[2:5, :, None]
        return Terms("torque", (joint,), values[0] * column, column[None])

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * float(np.sqrt(scale.motor_inertia * scale.neighbour_inertia)),)
