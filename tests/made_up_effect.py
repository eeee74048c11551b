"""An effect that the library does not have, written as `effects/saturating_friction.py` would be."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec


class SaturatingFriction(LawEffect):
    """Friction that builds up with speed and then stays: the film of a greased gear."""

    name = "saturating_friction"
    title = "Saturating friction"
    where = "motor"
    explanation = "Friction grows with the speed at first and approaches a constant."
    equation = "u = f_e (1 − exp(−|θ̇|/v_e)) sign(θ̇)"
    signature = "A smooth step against velocity, wider than that of Coulomb friction."
    confirm = "Motion at several constant speeds."
    reference = "Made up for the tests, 2026"
    parameters = (
        ParameterSpec("plateau", "Nm", 0.0, explanation="friction at high speed", symbol="f_e"),
        ParameterSpec("speed", "rad/s", 0.02, 5.0, "speed at which 63 % is reached", "v_e"),
    )
    smooth = True
    grid: ClassVar = {"speed": (0.1, 0.2, 0.4, 0.8)}

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        plateau, speed = values
        ratio = np.abs(motion.velocity) / speed
        sign = np.sign(motion.velocity)
        rise = sign * (1.0 - np.exp(-ratio))
        return plateau * rise, np.stack((rise, -plateau * sign * np.exp(-ratio) * ratio / speed))

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * scale.torque, 0.3 * scale.speed)
