"""Torque limit."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.targets import LeftOut, Written
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, ParameterSpec, Terms

SHARES = (0.6, 0.7, 0.8, 0.87, 0.93, 0.98)  # of the largest torque: limits that a search tries


class TorqueLimit(Effect):
    """A recorded command of which the drive gives no more than its limit.

    Where the record itself is limited it shows no command beyond, so that u is zero at the limit that it
    shows; such samples are left out of fits (`flexviz.checks.seen_limits`).
    """

    name = "torque_limit"
    title = "Torque limit"
    where = "sensing"
    plot_against = "recorded torque"
    explanation = (
        "The drive saturates: beyond its limit the recorded torque is a command that does not act. Where the "
        "record stands at a limit instead, the data show it, and those samples are left out."
    )
    equation = "τ_applied = τ_recorded within ±L, else ±L"
    signature = "A residual only where the recorded torque is large, as large as it exceeds the limit."
    confirm = "The same motion more slowly, or with a lighter payload, which stays within the limit."
    simulated = "The recorded torque stands at ±L where it is larger; the motor gets all of it."
    reference = (
        "Hippe: Windup in Control: Its Effects and Their Prevention, Advances in Industrial Control, "
        "Springer, 2006"
    )
    parameters = (ParameterSpec("limit", "Nm", 0.0, explanation="largest torque; 0: none", symbol="L"),)
    limits_torque = True
    size_at = ()
    servo_targets = MappingProxyType({
        "mjcf": Written("forcerange of the actuator"),
        "isaac": Written("effort_limit"),
        "bam": LeftOut(
            "BAM limits the duty cycle: max_pwm · vin · kt / R of the motor",
            "choose these so that their product is the limit",
        ),
        "urdf": LeftOut("the effort limits of a URDF are those of its author"),
    })  # fmt: skip

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        limit = float(values[0])
        columns = context.of_torque(place.own_joint, lambda tau: beyond(tau, limit))[..., None]
        return Terms("torque", (place.own_joint,), columns[0], columns[1:])

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        """What exceeds each of a few limits; a coefficient stands for the limit of that mean excess."""
        joint = place.own_joint
        tau = context.tau(joint)[0]
        largest = float(np.max(np.abs(tau)))
        limits = largest * np.linspace(1.0, 0.3, 36)
        excess = np.array([np.mean(np.abs(beyond(tau, limit)[0])) for limit in limits])
        made = context.once(
            ("torque limit", joint),
            lambda: context.of_torque(joint, lambda y: np.stack([beyond(y, s * largest)[0] for s in SHARES])),
        )

        def guess(share: float, column: Array) -> Guess:
            mean = float(np.interp(-share * largest, -limits, excess))

            def to_values(coefficients: Array) -> Array:
                return np.interp(coefficients * mean, excess, limits)

            return Guess("torque", (joint,), column[None, ..., None], to_values)

        return [guess(share, column) for share, column in zip(SHARES, made, strict=True)]

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (1.2 * scale.torque,)


def beyond(tau: Array, limit: float) -> Array:
    """What of τ (N,) exceeds ±limit, and its derivative by the limit, shape (2, N); none at 0."""
    if limit <= 0.0:
        return np.zeros((2, len(tau)))
    excess = np.maximum(np.abs(tau) - limit, 0.0)
    return np.stack((np.sign(tau) * excess, -np.sign(tau) * (excess > 0)))
