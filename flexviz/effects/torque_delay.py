"""Torque delay."""

from __future__ import annotations

import numpy as np

from flexviz.effects.effect import Effect, EffectEvidence, JointScale
from flexviz.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms

FINEST_DELAY = 0.02  # of the recording's step: accuracy of time stamps
FINEST_DELAY_BESIDE_TWIN = 0.1  # the same beside joint damping, which the torque's hold resembles


class TorqueDelay(Effect):
    name = "torque_delay"
    title = "Torque delay"
    where = "sensing"
    explanation = (
        "Torque and position are not recorded at the same instant: the torque acts later than its stamp."
    )
    equation = "τ_applied(t) = τ_recorded(t − d)"
    signature = "A residual proportional to the torque's rate of change."
    confirm = "Fast motions; a step of the reference."
    simulated = "The motor gets the torque d later than it is recorded."
    reference = "Björklund, Ljung: A review of time-delay estimation techniques, CDC 2003"
    parameters = (ParameterSpec("delay", "s", -0.1, 0.1, "how much later it acts", "d"),)
    scope = "set"
    twins = ("joint_damping",)
    joint_optional = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joints = tuple(range(context.joints())) if place.joint is None else (place.joint,)
        now = np.stack([context.tau(j)[:3] for j in joints], axis=2)
        late = np.stack([context.delayed_tau(j, float(values[0])) for j in joints], axis=2)
        return Terms("torque", joints, now - late[:3], late[1:4][None])

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        """Whether the delay exceeds the accuracy of time stamps, and of the torque's hold beside damping."""
        beside_twin = any(twin in evidence.effects for twin in self.twins)
        finest = FINEST_DELAY_BESIDE_TWIN if beside_twin else FINEST_DELAY
        return super().credible(values, evidence) and abs(values[0]) > finest * evidence.record_step

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.002,)
