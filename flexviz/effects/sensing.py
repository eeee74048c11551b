"""Effects of what is recorded rather than of the robot."""

from __future__ import annotations

import numpy as np

from flexviz.effects.base import Array, Context, Effect, EffectTarget, Entry, Guess, ParameterSpec, Terms


class TorqueGain(Effect):
    """The applied torque is not quite the recorded one."""

    name = "torque_gain"
    title = "Torque gain error"
    where = "sensing"
    explanation = "The recorded torque is wrong by a factor: the torque constant or the gear ratio is off."
    equation = "τ_applied = (1 + g) τ_recorded"
    signature = "A residual in proportion to the recorded torque."
    confirm = "A known payload: its weight is the yardstick."
    simulated = "The motor gets 1 + g times the torque that is recorded."
    reference = (
        "Gautier, Briot: Global identification of joint drive gains and dynamic parameters of robots, "
        "ASME J. Dynamic Systems, Measurement, and Control 136(5), 2014"
    )
    parameters = (
        ParameterSpec("gain_error", "-", lower=-0.8, upper=4.0, explanation="relative error", symbol="g"),
    )
    linear = True

    @property
    def entry(self) -> Entry:
        return "torque"

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        assert place.joint is not None
        column = -context.tau(place.joint)[:3, :, None]
        return Terms("torque", (place.joint,), values[0] * column, column[None])

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(1))
        return [Guess("torque", terms.joints, terms.slopes, lambda c: c)]


class TorqueDelay(Effect):
    """The torque acts a little later than it is recorded."""

    name = "torque_delay"
    title = "Torque delay"
    where = "sensing"
    explanation = (
        "Torque and position are not recorded at the same instant: the torque acts later than its stamp."
    )
    equation = "τ_applied(t) = τ_recorded(t − d)"
    signature = "A residual in proportion to the torque's rate of change."
    confirm = "Fast motions; a step of the reference."
    simulated = "The motor gets the torque d later than it is recorded."
    reference = "Björklund, Ljung: A review of time-delay estimation techniques, CDC 2003"
    parameters = (
        ParameterSpec("delay", "s", lower=-0.1, upper=0.1, explanation="how much later it acts", symbol="d"),
    )
    scope = "set"

    @property
    def entry(self) -> Entry:
        return "torque"

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joints = tuple(range(context.joints())) if place.joint is None else (place.joint,)
        now = np.stack([context.tau(j)[:3] for j in joints], axis=2)
        late = np.stack([context.delayed_tau(j, float(values[0])) for j in joints], axis=2)
        return Terms("torque", joints, now - late[:3], late[1:4][None])

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(1))
        return [Guess("torque", terms.joints, terms.slopes, lambda c: c)]
