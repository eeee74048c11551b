"""Friction drift."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, JointMotion, ParameterSpec


class FrictionDrift(LawEffect):
    name = "friction_drift"
    title = "Friction drift"
    where = "motor"
    plot_against = "warming time"
    explanation = (
        "Each run starts cold: viscous friction is higher at first and fades as the lubricant warms."
    )
    equation = "u = f_mv θ̇ · a exp(−t/T)"
    signature = "A velocity-proportional residual that fades over each group's time."
    confirm = "Long runs of a repeated motion."
    simulated = "f_mv θ̇ a exp(−t/T) opposes the motor, t from the start of each run."
    reference = (
        "Bittencourt, Wernholt, Sander-Tavallaey, Brogårdh: An extended friction model to capture load and "
        "temperature effects in robot joints, IROS 2010"
    )
    parameters = (
        ParameterSpec("relative_rise", "-", 0.0, 50.0, "extra friction at the start, relative to f_mv", "a"),
        ParameterSpec("time_constant", "s", 0.2, 2000.0, "time over which it fades to 37 %", "T"),
    )
    state = True
    smooth = True
    relative = True

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        rise, constant = values[0], max(values[1], 1e-3)
        fade = motion.motor_viscous * motion.velocity * np.exp(-motion.time / constant)
        return rise * fade, np.stack((fade, rise * fade * motion.time / constant**2))

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        longest = max(float(motion.time[-1]) for motion in context.motions(place.own_joint))
        return [self.guess(context, place, {1: share * longest}) for share in (0.08, 0.15, 0.3, 0.6, 1.5)]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.6, 0.4 * scale.duration)
