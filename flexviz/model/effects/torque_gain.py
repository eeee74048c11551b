"""Torque gain error."""

from __future__ import annotations

from types import MappingProxyType

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms

EXPECTED_GAIN_ERROR = 0.05  # of a drive whose data sheet is right


class TorqueGain(Effect):
    name = "torque_gain"
    title = "Torque gain error"
    where = "sensing"
    plot_against = "recorded torque"
    explanation = "The recorded torque is wrong by a factor: the torque constant or the gear ratio is off."
    equation = "τ_applied = (1 + g) τ_recorded"
    signature = "A residual proportional to the recorded torque."
    confirm = "A payload of known weight."
    simulated = "The motor gets 1 + g times the torque that is recorded."
    reference = (
        "Gautier, Briot: Global identification of joint drive gains and dynamic parameters of robots, "
        "ASME J. Dynamic Systems, Measurement, and Control 136(5), 2014"
    )
    parameters = (ParameterSpec("gain_error", "-", -0.8, 4.0, "relative error", "g"),)
    linear = True
    scales_torque = True
    expected = MappingProxyType({"gain_error": EXPECTED_GAIN_ERROR})

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        column = -context.tau(place.own_joint)[:3, :, None]
        return Terms("torque", (place.own_joint,), values[0] * column, column[None])

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.05,)
