"""Torque delay."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import Effect, EffectEvidence, JointScale
from flexviz.model.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms

FINEST_DELAY = 0.1  # of the recording's step: a drive holds its torque between the steps of its own clock


class TorqueDelay(Effect):
    name = "torque_delay"
    title = "Torque delay"
    where = "sensing"
    plot_against = "recorded torque's rate"
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
        """Whether the delay exceeds what the hold of a torque between two samples resembles."""
        return super().credible(values, evidence) and abs(values[0]) > FINEST_DELAY * evidence.record_step

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.002,)
