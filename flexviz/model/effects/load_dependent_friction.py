"""Load-dependent friction."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import HiddenStart, JointScale
from flexviz.model.effects.law import LinearEffect, LoadedEffect
from flexviz.model.effects.targets import OWN_VELOCITY, STEPPED, LeftOut, Written
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec, smooth_sign

SMALL = 0.05  # coefficient from which a fit finds one that seemed to be negative


class LoadDependentFriction(LinearEffect, LoadedEffect):
    name = "load_dependent_friction"
    title = "Load-dependent friction"
    where = "motor"
    plot_against = "load"
    explanation = "The gear's friction grows with the torque it transmits."
    equation = "u = μ |τ_j| sign(θ̇)"
    signature = "Coulomb-like steps whose size follows the load."
    confirm = "The same motion with different payloads."
    reference = (
        "Hamon, Gautier, Garrec: Dynamic identification of robots with a dry friction model depending "
        "on load and velocity, IROS 2010"
    )
    usual = True
    parameters = (
        ParameterSpec("coefficient", "-", 0.0, 0.9, "share of the transmitted torque that is lost", "μ"),
    )
    state = True
    servo_targets = MappingProxyType({
        "mjcf": LeftOut("MJCF has no load-dependent friction", STEPPED),
        "isaac": LeftOut("its PD actuators have no load-dependent friction; BamActuatorCfg has"),
        "bam": Written("load_friction_external", missing="BAM's load is gravity, without inertia"),
        "urdf": LeftOut(OWN_VELOCITY),
    })  # fmt: skip

    def columns(self, motion: JointMotion) -> Array:
        return (np.abs(motion.torque) * smooth_sign(motion.velocity))[np.newaxis]

    def torque_slope(self, motion: JointMotion, values: Array) -> Array:
        slope = values[0] * np.sign(motion.torque) * smooth_sign(motion.velocity)
        return slope / (1 + slope)

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.1,)

    @property
    def underrated(self) -> bool:
        return True  # with the link's own friction its load is wrong

    def hidden_starts(self, torque: Array, compliance: float, rough: float) -> list[HiddenStart]:
        return [HiddenStart((SMALL,), compliance)]
