"""Base tilt."""

from __future__ import annotations

import numpy as np

from flexviz.effects.effect import Effect, JointScale
from flexviz.effects.terms import Array, Context, EffectTarget, Entry, Guess, ParameterSpec, Terms

GRAVITY = 9.81  # [m/s²]


class BaseTilt(Effect):
    name = "base_tilt"
    title = "Base tilt"
    where = "load"
    plot_against = "law"
    explanation = "The robot does not stand level, so gravity comes from a slightly different direction."
    equation = "g = Rᵀ(0, 0, −9.81),  R = Ry(tilt_y) Rx(tilt_x)"
    signature = "A residual like gravity, but shifted by a quarter turn."
    confirm = "A spirit level, or motion of the first axis over a full turn."
    simulated = "Gravity points along Rᵀ(0, 0, −1)."
    reference = (
        "Featherstone: Rigid Body Dynamics Algorithms (gravity as the base's acceleration), Springer, 2008"
    )
    size_at = (0, 1)
    parameters = (
        ParameterSpec("tilt_x", "rad", -0.6, 0.6, "about the base's x"),
        ParameterSpec("tilt_y", "rad", -0.6, 0.6, "about the base's y"),
    )
    scope = "set"
    state = True
    twins = ("torque_offset",)

    @property
    def entry(self) -> Entry:
        return "gravity"

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        directions, slopes = tilted_gravity(*values)
        unit = np.stack([context.gravity_torque(axis) for axis in range(3)])  # torque per unit acceleration
        level = np.array([0.0, 0.0, -GRAVITY])
        value = np.tensordot(directions - level, unit, axes=1)[None]
        joints = tuple(range(context.joints()))
        return Terms(self.entry, joints, value, np.tensordot(slopes, unit, axes=1)[:, None])

    def gravity(self, values: Array) -> Array:
        return tilted_gravity(*values)[0]

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(2))
        return [Guess(terms.entry, terms.joints, terms.slopes, lambda c: np.clip(c, -0.5, 0.5))]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.02, 0.03)


def tilted_gravity(tilt_x: float, tilt_y: float) -> tuple[Array, Array]:
    """Rᵀ(0, 0, −g) for R = Ry(tilt_y) Rx(tilt_x), shape (3,), and its slopes, shape (2, 3) [m/s²]."""
    sx, cx, sy, cy = np.sin(tilt_x), np.cos(tilt_x), np.sin(tilt_y), np.cos(tilt_y)
    # third row of R: (−sin y, cos y sin x, cos y cos x)
    value = -GRAVITY * np.array([-sy, cy * sx, cy * cx])
    slopes = -GRAVITY * np.array([[0.0, cy * cx, -cy * sx], [-cy, -sy * sx, -sy * cx]])
    return value, slopes
