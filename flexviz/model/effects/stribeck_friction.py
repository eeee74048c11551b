"""Stribeck friction."""

from __future__ import annotations

from types import MappingProxyType
from typing import ClassVar

import numpy as np

from flexviz.model.effects.effect import EffectEvidence, JointScale
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.targets import OWN_VELOCITY, LeftOut, Written
from flexviz.model.effects.terms import ARMSTRONG, Array, JointMotion, ParameterSpec, smooth_sign

CREEPING = 0.5  # share of a joint's top speed; if v_s is that, 2 % of the friction is left there


class StribeckFriction(LawEffect):
    name = "stribeck_friction"
    title = "Stribeck friction"
    where = "motor"
    plot_against = "velocity"
    explanation = "Friction is higher at creeping speed than in motion: the lubricant film has not built up."
    equation = "u = f_s exp(−(θ̇/v_s)²) sign(θ̇)"
    signature = "A pair of peaks against velocity, on either side of standstill."
    confirm = "Very slow motion in both directions together with normal motion."
    reference = ARMSTRONG
    usual = True
    parameters = (
        ParameterSpec(
            "stribeck", "Nm", 0.0, explanation="friction at creeping speed above that in motion", symbol="f_s"
        ),
        ParameterSpec("velocity", "rad/s", 0.01, 3.0, "speed at which 37 % is left", "v_s"),
    )
    beside = "coulomb_friction"
    twins = ("thinning_friction",)
    grid: ClassVar = {"velocity": (0.03, 0.06, 0.1, 0.17, 0.3, 0.5, 0.9)}
    servo_targets: ClassVar = MappingProxyType({
        "mjcf": Written("LuGre friction of a passive dcmotor"),
        "isaac": Written("friction", missing="it ends as soon as the joint moves, not at v_s"),
        "bam": Written("friction_stribeck, dtheta_stribeck, alpha"),
        "urdf": LeftOut(OWN_VELOCITY),
    })  # fmt: skip

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        size, width = values[0], max(values[1], 1e-3)
        ratio = (motion.velocity / width) ** 2
        bell = np.exp(-ratio) * smooth_sign(motion.velocity)
        return size * bell, np.stack((bell, size * bell * 2 * ratio / width))

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """Not at speeds that the joint hardly exceeds: that is Coulomb friction."""
        return super().credible(values, evidence) and values[1] < CREEPING * evidence.top_speed

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * scale.torque, 0.2 * scale.speed)
