"""Effects of the drive that are not friction."""

from __future__ import annotations

import numpy as np

from flexviz.effects.base import (
    Array,
    Context,
    Effect,
    EffectTarget,
    Guess,
    JointMotion,
    LawEffect,
    LinearEffect,
    ParameterSpec,
    Terms,
)


class TorqueOffset(LinearEffect):
    """A constant torque, from a current sensor's offset or an asymmetric load."""

    name = "torque_offset"
    title = "Torque offset"
    where = "motor"
    explanation = (
        "The recorded torque is wrong by a constant, for example from a current sensor's zero error."
    )
    equation = "u = f_0"
    signature = "A constant, the same in every pose, direction and group."
    confirm = "Poses with opposite gravity load."
    reference = (
        "Swevers, Verdonck, De Schutter: Dynamic model identification for industrial robots, "
        "IEEE Control Systems Magazine 27(5), 2007"
    )
    parameters = (ParameterSpec("offset", "Nm", explanation="constant torque", symbol="f_0"),)
    smooth = True

    def columns(self, motion: JointMotion) -> Array:
        return np.ones((1, len(motion.time)))


ORDER = ParameterSpec("order", "-", 1.0, 400.0, "cycles a joint turn", "n", lower_occurs=True)
PHASE = ParameterSpec("phase", "rad", explanation="at θ = 0", symbol="φ")


class Ripple(LawEffect):
    """Shared by torque ripple and transmission error: a sin(nθ + φ)."""

    flexible = True
    smooth = True
    orders = tuple(range(1, 41))

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        amplitude, order, phase = values
        angle = order * motion.position + phase
        sine, cosine = np.sin(angle), np.cos(angle)
        return amplitude * sine, np.stack((sine, amplitude * motion.position * cosine, amplitude * cosine))

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        joint = place.joint
        assert joint is not None
        columns = context.once(("waves", joint, self.orders), lambda: self.waves(context, joint))
        out = []
        for k, order in enumerate(self.orders):

            def to_values(c: Array, n: float = float(order)) -> Array:
                return np.array([float(np.hypot(c[0], c[1])), n, float(np.arctan2(c[1], c[0]))])

            out.append(Guess(self.entry, (joint,), columns[2 * k : 2 * k + 2], to_values, f"order {order}"))
        return out

    def waves(self, context: Context, joint: int) -> Array:
        """Sine and cosine of every order, filtered: shape (2 · orders, 3, N, 1); the same for every model."""
        parts = [
            np.concatenate([(np.sin(n * m.position), np.cos(n * m.position)) for n in self.orders])
            for m in context.motions(joint)
        ]
        return context.filtered(parts, joint, 3)[..., None]


class TorqueRipple(Ripple):
    """Cogging and commutation torque of the motor, seen through the gear."""

    name = "torque_ripple"
    title = "Torque ripple"
    where = "motor"
    explanation = "Cogging of the motor or an eccentric gear: a torque that repeats with the angle."
    equation = "u = a sin(nθ + φ)"
    signature = "A sine against position, with the same phase in both directions and at any speed."
    confirm = "Slow motion over a wide range of angles."
    reference = (
        "Holtz, Springob: Identification and compensation of torque ripple in high-precision permanent "
        "magnet motor drives, IEEE Trans. Industrial Electronics 43(2), 1996"
    )
    parameters = (
        ParameterSpec("amplitude", "Nm", explanation="largest torque", symbol="a"),
        ORDER,
        PHASE,
    )


class MotorCoupling(Effect):
    """The neighbouring motor's acceleration felt in this joint."""

    name = "motor_coupling"
    title = "Motor coupling"
    where = "motor"
    explanation = (
        "The neighbouring motor's rotor accelerates this joint too: their axes share a gear or a housing."
    )
    equation = "u_i = B_ij θ̈_j"
    signature = "A residual in proportion to the neighbouring motor's acceleration."
    confirm = "Move the neighbouring joint alone."
    simulated = "B_ij θ̈_j opposes the motor i: its equation gets the neighbour's acceleration."
    reference = "Murphy, Wen, Saridis: Simulation and analysis of flexibly jointed manipulators, CDC 1990"
    parameters = (ParameterSpec("inertia", "kg m²", explanation="coupled rotor inertia", symbol="B_ij"),)
    linear = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joint = place.joint
        assert joint is not None
        other = joint + 1 if joint + 1 < context.joints() else joint - 1
        column = context.theta(other)[2:5, :, None]
        return Terms("torque", (joint,), values[0] * column, column[None])

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(1))
        return [Guess("torque", terms.joints, terms.slopes, lambda c: c)]
