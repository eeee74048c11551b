"""Base tilt."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.terms import Array, Context, EffectTarget, Entry, Guess, ParameterSpec, Terms
from flexviz.robot.mounting import GRAVITY, upright


class BaseTilt(Effect):
    name = "base_tilt"
    title = "Base tilt"
    where = "load"
    plot_against = "law"
    explanation = (
        "The robot is mounted slightly differently than stated (upright where nothing is), "
        "so gravity comes from a slightly different direction."
    )
    equation = "g = Rᵀ(0, 0, −9.81),  R = Ry(tilt_y) Rx(tilt_x)"
    signature = "A residual like gravity, but shifted by a quarter turn."
    confirm = "A spirit level, or motion of the first axis over a full turn."
    simulated = "Gravity points along Rᵀ(0, 0, −1)."
    reference = (
        "Featherstone: Rigid Body Dynamics Algorithms (gravity as the base's acceleration), Springer, 2008"
    )
    size_at = (0, 1)
    parameters = (
        ParameterSpec("tilt_x", "rad", -0.6, 0.6, "about the base's x, if stated upright"),
        ParameterSpec("tilt_y", "rad", -0.6, 0.6, "about the base's y, if stated upright"),
    )
    scope = "set"
    state = True
    twins = ("torque_offset",)

    @property
    def entry(self) -> Entry:
        return "gravity"

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        stated = context.gravity()
        directions, slopes = tilted_gravity(values[0], values[1], stated)
        unit = np.stack([context.gravity_torque(axis) for axis in range(3)])  # torque per unit acceleration
        value = np.tensordot(directions - stated, unit, axes=1)[None]
        joints = tuple(range(context.joints()))
        return Terms(self.entry, joints, value, np.tensordot(slopes, unit, axes=1)[:, None])

    def gravity(self, values: Array, stated: Array) -> Array:
        return tilted_gravity(values[0], values[1], stated)[0]

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(2))
        return [Guess(terms.entry, terms.joints, terms.slopes, lambda c: np.clip(c, -0.5, 0.5))]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.02, 0.03)


def tilted_gravity(
    tilt_x: float, tilt_y: float, stated: Array | tuple[float, ...] = GRAVITY
) -> tuple[Array, Array]:
    """Rᵀ(0, 0, −g) for R = Ry(tilt_y) Rx(tilt_x), shape (3,), and its slopes, shape (2, 3) [m/s²].

    They are turned into the base's frame from the one in which the `stated` gravity (3,) points down.
    """
    sx, cx, sy, cy = np.sin(tilt_x), np.cos(tilt_x), np.sin(tilt_y), np.cos(tilt_y)
    # third row of R: (−sin y, cos y sin x, cos y cos x)
    value = np.array([-sy, cy * sx, cy * cx])
    slopes = np.array([[0.0, cy * cx, -cy * sx], [-cy, -sy * sx, -sy * cx]])
    to_base = -np.linalg.norm(stated) * upright(stated)
    return value @ to_base, slopes @ to_base
