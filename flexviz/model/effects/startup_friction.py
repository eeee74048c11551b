"""Start-up friction."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LawEffect, chained
from flexviz.model.effects.terms import ARMSTRONG, Array, JointMotion, ParameterSpec, smooth_sign

REST_SPEED = 0.005  # [rad/s] a slower joint stands still; that of the sign's smoothing
REST_TIME = 0.1  # [s] of standstill that restores 63 % of the additional friction
INITIAL_SPREAD = 3**-0.5  # rms of the part that is worn off at the start of a record, uniform within 0 … 1


class StartupFriction(LawEffect):
    """The break-away torque after rest, which fades along the path.

    y is the part that is worn off. With g = exp(−(θ̇/0.005 rad/s)²), which is one at rest and zero in motion,

        ẏ = (1 − y) |θ̇|/x_s − y g / 0.1 s,   u = f_s (1 − y) sign(θ̇)

    After a rest of some tenths of a second y is zero, and in motion 1 − y = exp(−path/x_s): only the path
    counts, not the speed. A reversal without rest restores hardly anything.

    y at the start of a record is unknown. The law starts from rest; y₀ subtracts f_s y₀ sign(θ̇) times the
    product of all decays.
    """

    name = "startup_friction"
    title = "Start-up friction"
    where = "motor"
    plot_against = "path since rest"
    explanation = (
        "A joint that stood still needs more torque to start, which fades over hundredths of a radian."
    )
    equation = "u = f_s exp(−x/x_s) sign(θ̇),  x the path since the last standstill"
    signature = (
        "A peak at every start from rest and none at a reversal without rest. It follows the path whatever "
        "the speed (Stribeck friction follows the speed) and falls from the start on (presliding builds up)."
    )
    confirm = "Starts from rest at different accelerations, and reversals without a pause."
    simulated = (
        "The part that is worn off is a state, zero at the start of each run. It grows with the path and "
        "returns to zero within 0.1 s below 0.005 rad/s."
    )
    reference = ARMSTRONG
    parameters = (
        ParameterSpec("startup", "Nm", 0.0, explanation="additional friction at the start", symbol="f_s"),
        ParameterSpec("angle", "rad", 1e-3, 0.5, "path over which it fades to 37 %", "x_s"),
    )
    beside = "coulomb_friction"
    memory = True
    only_among_many = True
    after_rest = True
    grid: ClassVar = {"angle": (0.006, 0.015, 0.04, 0.1)}

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        worn, slope = worn_off(motion.position, motion.step, values[1])
        sign = smooth_sign(motion.velocity)
        return values[0] * (1 - worn) * sign, np.stack(((1 - worn) * sign, -values[0] * slope * sign))

    def unknown(self, motion: JointMotion, values: Array) -> Array:
        path, healing = _moves(motion.position, motion.step)
        left = np.exp(-np.concatenate(([0.0], np.cumsum(path / max(values[1], 1e-4) + healing))))
        return (INITIAL_SPREAD * values[0] * left * smooth_sign(motion.velocity))[None]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.2 * scale.torque, 0.02)


def worn_off(position: Array, step: float, angle: float) -> tuple[Array, Array]:
    """y and ∂y/∂x_s, (N,) each, from rest, exact for constant speed between samples.

    `position`: (N,) [rad]; `step` between them [s]; `angle`: x_s [rad].
    """
    angle = max(angle, 1e-4)
    path, healing = _moves(position, step)
    wear = path / angle
    rate = wear + healing
    target, fade = wear / rate, np.exp(-rate)
    worn = chained(fade, target * (1 - fade))
    wear_slope = -wear / angle
    target_slope = wear_slope * healing / rate**2
    change = target_slope * (1 - fade) - (worn[:-1] - target) * wear_slope * fade
    return worn, chained(fade, change)


def _moves(position: Array, step: float) -> tuple[Array, Array]:
    """Of each step of positions (N,): the path [rad], and the time at rest relative to `REST_TIME`."""
    path = np.abs(np.diff(position))
    return path, step / REST_TIME * np.exp(-((path / step / REST_SPEED) ** 2)) + 1e-12
