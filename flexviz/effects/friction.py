"""Friction effects of motor and link that follow from the velocity at the same instant."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from flexviz.effects.base import (
    Array,
    Context,
    EffectTarget,
    Guess,
    JointMotion,
    LawEffect,
    LinearEffect,
    ParameterSpec,
    smooth_sign,
)

_ARMSTRONG = (
    "Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation methods "
    "for the control of machines with friction, Automatica 30(7), 1994"
)

_SLIDING = ParameterSpec("coulomb", "Nm", lower=0.0, explanation="friction torque while moving", symbol="f_c")


class CoulombFriction(LinearEffect):
    """Dry friction between motor and gear: a constant torque against the motor's motion."""

    name = "coulomb_friction"
    title = "Coulomb friction"
    where = "motor"
    explanation = "Dry friction in the motor and gear: a constant torque that always opposes the motion."
    equation = "u = f_c sign(θ̇)"
    signature = "A step at every reversal of the motor, of the same size at any speed and load."
    confirm = "Slow motions with many reversals."
    reference = _ARMSTRONG
    parameters = (_SLIDING,)

    def columns(self, motion: JointMotion) -> Array:
        return smooth_sign(motion.velocity)[np.newaxis]


class LinkCoulombFriction(LinearEffect):
    """Dry friction in the link's bearing, behind the elastic transmission."""

    name = "link_coulomb_friction"
    title = "Coulomb friction at the link"
    where = "link"
    explanation = "Dry friction in the link's bearing or seals, on the far side of the elastic gear."
    equation = "u = f_c sign(q̇)"
    signature = "A step at every reversal of the link; near reversals the link and the motor part company."
    confirm = "Reversals under load with a soft joint, where link and motor reverse at different instants."
    reference = _ARMSTRONG
    parameters = (_SLIDING,)
    state = True

    def columns(self, motion: JointMotion) -> Array:
        return smooth_sign(motion.link_velocity)[np.newaxis]


class StribeckFriction(LawEffect):
    """The extra friction at creeping speed, before the lubricant carries."""

    name = "stribeck_friction"
    title = "Stribeck friction"
    where = "motor"
    explanation = "Friction is higher at creeping speed than in motion: the lubricant film has not built up."
    equation = "u = f_s exp(−(θ̇/v_s)²) sign(θ̇)"
    signature = "A pair of peaks against velocity, on either side of standstill."
    confirm = "Very slow motion in both directions beside normal motion."
    reference = _ARMSTRONG
    parameters = (
        ParameterSpec(
            "stribeck", "Nm", 0.0, explanation="friction at creeping speed above that in motion", symbol="f_s"
        ),
        ParameterSpec("velocity", "rad/s", 0.01, 3.0, "speed at which 37 % is left", "v_s"),
    )
    beside = "coulomb_friction"
    grid: ClassVar = {"velocity": (0.03, 0.06, 0.1, 0.17, 0.3, 0.5, 0.9)}

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        size, width = values[0], max(values[1], 1e-3)
        ratio = (motion.velocity / width) ** 2
        bell = np.exp(-ratio) * smooth_sign(motion.velocity)
        return size * bell, np.stack((bell, size * bell * 2 * ratio / width))


class QuadraticFriction(LinearEffect):
    """Friction that grows with the square of the speed."""

    name = "quadratic_friction"
    title = "Quadratic friction"
    where = "motor"
    explanation = "Churning of lubricant or fan losses: friction grows with the square of the speed."
    equation = "u = f_q θ̇ |θ̇|"
    signature = "A parabola against velocity, with opposite signs in the two directions."
    confirm = "The same motion at clearly different speeds."
    reference = _ARMSTRONG
    parameters = (
        ParameterSpec("quadratic", "Nm s²/rad²", lower=0.0, explanation="friction at 1 rad/s", symbol="f_q"),
    )
    smooth = True

    def columns(self, motion: JointMotion) -> Array:
        return (motion.velocity * np.abs(motion.velocity))[np.newaxis]


class LoadDependentFriction(LinearEffect):
    """Gear friction in proportion to the torque it transmits."""

    name = "load_dependent_friction"
    title = "Load-dependent friction"
    where = "motor"
    explanation = "The gear's friction grows with the torque it transmits."
    equation = "u = μ |τ_j| sign(θ̇)"
    signature = "Coulomb-like steps whose size follows the load."
    confirm = "The same motion with different payloads."
    reference = (
        "Hamon, Gautier, Garrec: Dynamic identification of robots with a dry friction model depending "
        "on load and velocity, IROS 2010"
    )
    parameters = (
        ParameterSpec("coefficient", "-", 0.0, 0.9, "share of the transmitted torque that is lost", "μ"),
    )
    state = True

    def columns(self, motion: JointMotion) -> Array:
        return (np.abs(motion.torque) * smooth_sign(motion.velocity))[np.newaxis]


class FrictionDrift(LawEffect):
    """Viscous friction of a cold gear that warms up during each run."""

    name = "friction_drift"
    title = "Friction drift"
    where = "motor"
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
        out = []
        longest = max(float(m.time[-1]) for m in context.motions(place.joint))  # type: ignore[arg-type]
        for share in (0.08, 0.15, 0.3, 0.6, 1.5):
            constant = share * longest
            whole = self.guess(context, place, np.array([0.0, constant]))
            out.append(
                Guess(
                    whole.entry, whole.joints, whole.columns[:1],
                    lambda c, t=constant: np.array([c[0], t]), f"time constant {constant:.3g} s",
                )
            )  # fmt: skip
        return out
