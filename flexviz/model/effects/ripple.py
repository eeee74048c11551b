"""Ripple with the motor angle, shared by torque ripple and transmission error."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import EffectEvidence
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, JointMotion, ParameterSpec

ORDER = ParameterSpec(
    "order", "-", 1.0, 400.0, "cycles per joint turn", "n", lower_occurs=True, sliding_unit="rad/m"
)
LEAST_PERIODS = 2.0  # in a joint's travel, with which a law is seen to repeat
PHASE = ParameterSpec("phase", "rad", explanation="at θ = 0", symbol="φ", sliding_unit="rad")


class Ripple(LawEffect):
    """a sin(nθ + φ)."""

    smooth = True
    plot_against = "angle within a cycle"
    orders = tuple(range(1, 41))

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        amplitude, order, phase = values
        angle = order * motion.position + phase
        sine, cosine = np.sin(angle), np.cos(angle)
        return amplitude * sine, np.stack((sine, amplitude * motion.position * cosine, amplitude * cosine))

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """With two periods in the motion: fewer resemble any law of the position, unless nothing is left."""
        periods = values[1] * evidence.travel / (2 * np.pi)
        return super().credible(values, evidence) and (periods >= LEAST_PERIODS or evidence.explained)

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        joint = place.own_joint
        columns = context.once(("waves", joint, self.orders), lambda: self.waves(context, joint))
        out = []
        for k, order in enumerate(self.orders):

            def to_values(c: Array, n: float = float(order)) -> Array:
                return np.array([float(np.hypot(c[0], c[1])), n, float(np.arctan2(c[1], c[0]))])

            out.append(Guess(self.entry, (joint,), columns[2 * k : 2 * k + 2], to_values))
        return out

    def waves(self, context: Context, joint: int) -> Array:
        """Sine and cosine of every order, filtered: shape (2 · orders, 3, N, 1); the same for every model."""
        motions, parts = context.motions(joint), []
        highest = max(self.orders) * max(float(np.abs(motion.velocity).max()) for motion in motions)
        every = context.decimation(joint, 3, 1.5 * highest)  # the angle's own change broadens the line
        for motion, step in zip(motions, every, strict=True):
            turning = np.exp(1j * motion.position[::step])
            powers = np.cumprod(np.broadcast_to(turning, (max(self.orders), len(turning))), axis=0)
            chosen = powers[np.array(self.orders) - 1]
            parts.append(np.stack((chosen.imag, chosen.real), axis=1).reshape(-1, len(turning)))
        return context.filtered(parts, joint, 3, every)[..., None]
