"""Torque offset."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import JointScale
from flexviz.model.effects.law import LinearEffect
from flexviz.model.effects.targets import Written, not_held
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec


class TorqueOffset(LinearEffect):
    name = "torque_offset"
    title = "Torque offset"
    where = "motor"
    sensed = True
    plot_against = "position"
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
    usual = True
    constant = True
    parameters = (ParameterSpec("offset", "Nm", explanation="constant torque", symbol="f_0"),)
    smooth = True
    twins = ("base_tilt", "gravity_compensator")
    common = True
    servo_targets = MappingProxyType({
        "mjcf": Written("constant torque of a passive dcmotor"),
        **not_held(
            "send goals that are smaller by offset / gain",
            isaac="its actuators have no constant torque", bam="BAM has no constant torque",
        ),
    })  # fmt: skip

    def columns(self, motion: JointMotion) -> Array:
        return np.ones((1, len(motion.time)))

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.15 * scale.torque,)
