"""Load-dependent friction that differs with who drives, the motor or the load."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from flexviz.model.effects.effect import HiddenStart, JointScale
from flexviz.model.effects.law import LinearEffect, LoadedEffect
from flexviz.model.effects.targets import OWN_VELOCITY, STEPPED, LeftOut, Written
from flexviz.model.effects.terms import Array, JointMotion, ParameterSpec, smooth_sign

SMALL = 0.05  # coefficients from which a fit finds those that seemed to be negative


class DrivingFriction(LinearEffect, LoadedEffect):
    """μ_m |τ_j| sign(θ̇) while the motor drives, τ_j θ̇ > 0, and μ_l |τ_j| sign(θ̇) while the load does.

    In motion this is friction (μ_m + μ_l)/2 |τ_j| sign(θ̇) and a torque (μ_m − μ_l)/2 τ_j, which acts like a
    torque gain but for standstill, where friction is zero. Known payloads, or the motor's inertia, show it.
    """

    name = "driving_friction"
    title = "Driving-dependent friction"
    where = "motor"
    plot_against = "load"
    explanation = (
        "The gear's friction grows with the torque it transmits, differently when the motor drives the load "
        "and when the load drives the motor."
    )
    equation = "u = μ |τ_j| sign(θ̇), μ = μ_m where τ_j θ̇ > 0, else μ_l"
    signature = (
        "Steps at reversals whose size follows the load, larger on one side of zero torque: "
        "lifting and lowering the same weight lose different shares."
    )
    confirm = "Lifting and lowering payloads of known weight at the same speeds, with rests under load."
    reference = (
        "Duclusaud, Passault, Padois, Ly: Extended friction models for the physics simulation of servo "
        "actuators, IEEE International Conference on Robotics and Automation, 2025"
    )
    parameters = (
        ParameterSpec("motor_driving", "-", 0.0, 0.9, "share of the torque lost as the motor drives", "μ_m"),
        ParameterSpec("load_driving", "-", 0.0, 0.9, "share of the torque lost as the load drives", "μ_l"),
    )
    state = True
    replaces = "load_dependent_friction"
    instead_of = "load_dependent_friction"
    merges = ("load_dependent_friction", "torque_gain")
    size_at = (0, 1)
    servo_targets = MappingProxyType({
        "mjcf": LeftOut("MJCF has no load-dependent friction", STEPPED),
        "isaac": LeftOut("its PD actuators have no load-dependent friction; BamActuatorCfg has"),
        "bam": Written(
            "load_friction_motor, load_friction_external",
            missing="the same in slow motion only: BAM weighs motor torque and gravity",
        ),
        "urdf": LeftOut(OWN_VELOCITY),
    })  # fmt: skip

    def columns(self, motion: JointMotion) -> Array:
        friction = np.abs(motion.torque) * smooth_sign(motion.velocity)
        driving = motion.torque * motion.velocity > 0
        return np.stack((np.where(driving, friction, 0.0), np.where(driving, 0.0, friction)))

    def torque_slope(self, motion: JointMotion, values: Array) -> Array:
        share = np.where(motion.torque * motion.velocity > 0, values[0], values[1])
        slope = share * np.sign(motion.torque) * smooth_sign(motion.velocity)
        return slope / (1 + slope)

    def refining(self, simpler: Array) -> Array:
        return np.array([simpler[0], simpler[0]])

    def merged(self, values: Mapping[str, Array]) -> Array:
        """(1 + g) τ − … = s + μ |s| sign(θ̇) is τ − … = s + (μ |s| sign(θ̇) − g s)/(1 + g)."""
        (mean,), (gain,) = (values[name] for name in self.merges)
        return np.clip(np.array([mean - gain, mean + gain]) / (1 + gain), 0.01 * SMALL, None)

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.1, 0.15)

    @property
    def underrated(self) -> bool:
        return True  # with the link's own friction its load is wrong

    def hidden_starts(self, torque: Array, compliance: float, rough: float) -> list[HiddenStart]:
        return [HiddenStart((SMALL, SMALL), compliance)]
