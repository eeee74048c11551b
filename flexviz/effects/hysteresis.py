"""Friction with memory."""

from __future__ import annotations

import numpy as np

from flexviz.effects.base import Array, Context, Guess, JointMotion, LawEffect, ParameterSpec, Place


class PreslidingHysteresis(LawEffect):
    """The Dahl model: before it slides, friction is a spring.

    With h = σz/f_c and ρ = σ/f_c the state obeys dh = (dθ − |dθ| h) ρ: between reversals h runs towards ±1 as
    exp(−ρ·path), so only the path matters, not the speed.
    """

    name = "presliding_hysteresis"
    title = "Presliding hysteresis"
    where = "motor"
    explanation = (
        "Before the gear slides, dry friction acts like a spring: torque builds up over a small angle."
    )
    equation = "ż = θ̇ − |θ̇| z σ/f_c,  u = σ z"
    signature = "Coulomb-like steps that are rounded over an angle f_c/σ after every reversal."
    confirm = "Small back-and-forth motions about several positions."
    reference = "Dahl: Solid friction damping of mechanical vibrations, AIAA Journal 14(12), 1976"
    parameters = (
        ParameterSpec("presliding_stiffness", "Nm/rad", lower=1e-3, explanation="stiffness before it slides"),
        ParameterSpec("coulomb", "Nm", lower=0.0, explanation="friction torque while sliding"),
    )
    replaces = "coulomb_friction"

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        coulomb = max(values[1], 1e-9)
        rate = max(values[0], 1e-6) / coulomb
        h, slope = dahl(motion.position, rate)
        # u = f_c h(ρ), ρ = σ/f_c
        return coulomb * h, np.stack((slope, h - rate * slope))

    def guesses(self, context: Context, place: Place) -> list[Guess]:
        out = []
        for angle in (0.005, 0.012, 0.025, 0.05, 0.1, 0.2):
            parts = [dahl(m.position, 1 / angle)[0][None] for m in context.motions(place.joint)]  # type: ignore[arg-type]
            column = context.filtered(parts, place.joint, 3)[..., None]  # type: ignore[arg-type]
            out.append(
                Guess(
                    "torque", (place.joint,), column,  # type: ignore[arg-type]
                    lambda c, a=angle: np.array([c[0] / a, c[0]]), f"presliding angle {angle:g} rad",
                )
            )  # fmt: skip
        return out


def dahl(position: Array, rate: float) -> tuple[Array, Array]:
    """h and ∂h/∂ρ along a motion that starts from an unknown, taken as relaxed, state.

    Args:
        position: shape (N,) [rad].
        rate: ρ [1/rad].

    Returns:
        two arrays of shape (N,).
    """
    step = np.diff(position)
    fade = np.exp(-rate * np.abs(step))
    target = np.sign(step)
    h, slope = np.zeros(len(position)), np.zeros(len(position))
    now, change = 0.0, 0.0
    lost = np.abs(step)
    for k, (f, t, d) in enumerate(zip(fade.tolist(), target.tolist(), lost.tolist(), strict=True)):
        change = f * change - d * f * (now - t)
        now = t + (now - t) * f
        h[k + 1], slope[k + 1] = now, change
    return h, slope
