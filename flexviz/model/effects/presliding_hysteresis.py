"""Friction with memory: the Dahl model."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import EffectEvidence, JointScale
from flexviz.model.effects.law import LawEffect, chained
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, JointMotion, ParameterSpec

START_ANGLE = 0.01  # [rad] over which friction builds up, where a fit starts
SMALLEST_ANGLE = 1e-5  # [rad] over which friction builds up
INITIAL_SPREAD = 3**-0.5  # standard deviation of h at the start of a record, uniform within ±1


class PreslidingHysteresis(LawEffect):
    """The Dahl model: before it slides, friction is a spring.

    With h = σz/f_c and ρ = σ/f_c the state obeys dh = (dθ − |dθ| h) ρ: between reversals h runs towards ±1 as
    exp(−ρ·path), so only the path matters, not the speed.

    h at the start of a record is unknown within ±1. The law starts from zero; another initial value h₀ adds
    f_c h₀ exp(−ρ·path).
    """

    name = "presliding_hysteresis"
    title = "Presliding hysteresis"
    where = "motor"
    plot_against = "path since reversal"
    explanation = (
        "Before the gear slides, dry friction acts like a spring: torque builds up over a small angle."
    )
    equation = "ż = θ̇ − |θ̇| z σ/f_c,  u = σ z"
    signature = "Coulomb-like steps that are rounded over an angle f_c/σ after every reversal."
    confirm = "Small back-and-forth motions about several positions."
    simulated = "z is a state of the simulation, zero at the start of each run; σ z opposes the motor."
    reference = "Dahl: Solid friction damping of mechanical vibrations, AIAA Journal 14(12), 1976"
    parameters = (
        ParameterSpec("presliding_stiffness", "Nm/rad", 1e-3, explanation="before it slides", symbol="σ"),
        ParameterSpec("coulomb", "Nm", 0.0, explanation="friction torque while sliding", symbol="f_c"),
    )
    replaces = "coulomb_friction"
    size_at = (1,)
    memory = True
    hidden_state = True  # the deflection of the bristles

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        coulomb = max(values[1], 1e-9)
        rate = max(values[0], 1e-6) / coulomb
        h, slope = dahl(motion.position, rate)
        # u = f_c h(ρ), ρ = σ/f_c
        return coulomb * h, np.stack((slope, h - rate * slope))

    def unknown(self, motion: JointMotion, values: Array) -> Array:
        coulomb = max(values[1], 1e-9)
        path = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(motion.position)))))
        fade = np.exp(-max(values[0], 1e-6) / coulomb * path)
        return (INITIAL_SPREAD * coulomb * fade)[None]

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        joint, motions = place.own_joint, context.motions(place.own_joint)
        out = []
        for angle in (0.005, 0.012, 0.025, 0.05, 0.1, 0.2):
            parts = [dahl(motion.position, 1 / angle)[0][None] for motion in motions]

            def to_values(c: Array, angle: float = angle) -> Array:
                return np.array([c[0] / angle, c[0]])

            column = context.filtered(parts, joint, self.depth)[..., None]
            out.append(Guess(self.entry, (joint,), column, to_values))
        return out

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """Not over an angle that no record resolves: that is sliding friction."""
        return super().credible(values, evidence) and values[1] > SMALLEST_ANGLE * values[0]

    def refining(self, simpler: Array) -> Array:
        return np.array([simpler[0] / START_ANGLE, simpler[0]])

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (50.0 * scale.torque, 0.2 * scale.torque)


def dahl(position: Array, rate: float) -> tuple[Array, Array]:
    """h and ∂h/∂ρ, (N,) each, along positions (N,) [rad] from h = 0; `rate` is ρ [1/rad].

    Between reversals the law has a closed form in the path since the last reversal; only the values at
    reversals are computed recursively.
    """
    sign = np.sign(np.diff(position))
    first = np.flatnonzero(sign != 0)  # of each run in one direction; standstill belongs to the run before
    if not len(first):
        return np.zeros(len(position)), np.zeros(len(position))
    first = first[np.diff(sign[first], prepend=0.0) != 0]
    target, ends = sign[first], np.append(first, len(position) - 1)
    length = np.abs(np.diff(position[ends]))
    fade = np.exp(-rate * length)
    h_first = chained(fade, target * (1.0 - fade))
    slope_first = chained(fade, -length * fade * (h_first[:-1] - target))

    run = np.repeat(np.arange(len(first)), np.diff(ends))
    gone = np.abs(position[first[0] + 1 :] - position[first][run])
    left = np.exp(-rate * gone)
    away = (h_first[:-1] - target)[run]
    still = np.zeros(first[0] + 1)
    h = np.concatenate((still, target[run] + away * left))
    return h, np.concatenate((still, left * (slope_first[run] - gone * away)))
