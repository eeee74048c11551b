"""Cable spring."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import Effect, JointScale
from flexviz.model.effects.targets import LeftOut, Written
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, ParameterSpec, Terms


class CableSpring(Effect):
    name = "cable_spring"
    title = "Cable spring"
    where = "link"
    plot_against = "link position"
    explanation = "Cables, hoses or a balancer pull the joint towards a rest angle like a spring."
    equation = "u = k_c (q − q₀)"
    signature = "A straight line against position, the same in both directions."
    confirm = "Slow motion over the whole range, in poses with different gravity load."
    reference = (
        "Swevers, Verdonck, De Schutter: Dynamic model identification for industrial robots, "
        "IEEE Control Systems Magazine 27(5), 2007"
    )
    usual = True
    twins = ("gravity_compensator",)
    offset_parameter = "rest_angle"
    parameters = (
        ParameterSpec("stiffness", "Nm/rad", 0.0, explanation="of the spring", symbol="k_c"),
        ParameterSpec("rest_angle", "rad", -50.0, 50.0, "angle of zero torque", "q₀"),
    )
    state = True
    servo_targets = MappingProxyType({
        "mjcf": Written("stiffness and springref of the joint"),
        "isaac": LeftOut("its joints have no springs beside the drive"),
        "bam": LeftOut("BAM has no springs"),
        "urdf": LeftOut("a URDF has no springs"),
    })  # fmt: skip

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        q = context.link_state(place.own_joint)[:1, :, None]
        slopes = np.stack((q - values[1], np.full_like(q, -values[0])))
        return Terms("residual", (place.own_joint,), values[0] * (q - values[1]), slopes)

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        q = context.link_state(place.own_joint)[:1, :, None]

        def to_values(c: Array) -> Array:
            return np.array([c[0], -c[1] / c[0] if c[0] else 0.0])

        return [Guess("residual", (place.own_joint,), np.stack((q, np.ones_like(q))), to_values)]

    def with_constant(self, values: Array, torque: float) -> Array:
        stiffness, rest_angle = values
        return np.array([stiffness, rest_angle - torque / stiffness]) if stiffness else values

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.3 * scale.torque, scale.position + 0.2)
