"""Payload error."""

from __future__ import annotations

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms


class PayloadError(Effect):
    name = "payload_error"
    title = "Payload error"
    where = "load"
    plot_against = "payload's torque"
    explanation = "The named payload's mass and inertia are wrong by a common factor."
    equation = "Γ_payload → (1 + e) Γ_payload"
    signature = "A residual like the payload's own weight, in the groups that carry it."
    confirm = "Weigh the payload, or run the same motion without it."
    simulated = "The payload's mass and inertia are multiplied by 1 + e in the runs that carry it."
    reference = (
        "Khalil, Gautier, Lemoine: Identification of the payload inertial parameters of industrial "
        "manipulators, ICRA 2007"
    )
    parameters = (
        ParameterSpec("relative_mass_error", "-", -0.95, 10.0, "true over stated mass, minus one", "e"),
    )
    scope = "payload"
    state = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        assert place.payload is not None
        column = context.payload_torque(place.payload)[None]
        return Terms("residual", tuple(range(context.joints())), values[0] * column, column[None])

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.1,)
