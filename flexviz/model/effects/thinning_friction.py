"""Shear-thinning friction."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec


class ThinningFriction(LawEffect):
    """Viscous friction that rises less and less with speed.

    A negative quadratic term describes the same curve within a recorded range, but drives the motor beyond
    it. This law opposes the motion at any speed.
    """

    name = "thinning_friction"
    title = "Shear-thinning friction"
    where = "motor"
    plot_against = "velocity"
    explanation = "Sheared lubricant thins: friction rises steeply at low speed and levels off at high speed."
    equation = "u = f_t asinh(θ̇/v_t)"
    signature = (
        "A curve against velocity that is steep near standstill and bends towards the axis on both sides."
    )
    confirm = "Steady motion at many speeds from creeping to fast, at constant temperature."
    reference = (
        "Eyring: Viscosity, plasticity, and diffusion as examples of absolute reaction rates, "
        "The Journal of Chemical Physics 4(4), 1936"
    )
    parameters = (
        ParameterSpec("thinning", "Nm", 0.0, explanation="scale of the torque", symbol="f_t"),
        ParameterSpec("velocity", "rad/s", 1e-5, 3.0, "speed from which it bends", "v_t"),
    )
    smooth = True
    twins = ("stribeck_friction",)
    instead_of = "coulomb_friction"
    only_among_many = True
    grid: ClassVar = {"velocity": (0.003, 0.03, 0.08, 0.2, 0.5)}

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        size, width = values[0], max(values[1], 1e-6)
        ratio = motion.velocity / width
        curve = np.arcsinh(ratio)
        return size * curve, np.stack((curve, -size * ratio / width / np.sqrt(1 + ratio**2)))

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.1 * scale.torque, 0.2 * scale.speed)
