"""The effects' laws as the simulator knows them: one small function each, in the units of the joint side.

They are written down here once more, on purpose: the simulated truth and the estimator share no code.

A *motor* law gives a torque that opposes the motor:   f(t, θ, θ̇, τ_j) [Nm]
A *link* law gives a torque that opposes the link:     f(t, q, q̇) [Nm]
sign(v) is tanh(v / 0.005 rad/s).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, sin, tanh

SIGN_WIDTH = 0.005  # [rad/s]

MotorLaw = Callable[[float, float, float, float], float]
LinkLaw = Callable[[float, float, float], float]


@dataclass(frozen=True)
class LawInfo:
    """Where an effect acts, its parameters' units, and what it belongs to ("joint", "payload", "set")."""

    where: str
    units: dict[str, str]
    belongs_to: str = "joint"


LAWS: dict[str, LawInfo] = {
    "coulomb_friction": LawInfo("motor", {"coulomb": "Nm"}),
    "stribeck_friction": LawInfo("motor", {"stribeck": "Nm", "velocity": "rad/s"}),
    "quadratic_friction": LawInfo("motor", {"quadratic": "Nm s²/rad²"}),
    "load_dependent_friction": LawInfo("motor", {"coefficient": "-"}),
    "presliding_hysteresis": LawInfo("motor", {"presliding_stiffness": "Nm/rad", "coulomb": "Nm"}),
    "friction_drift": LawInfo("motor", {"relative_rise": "-", "time_constant": "s"}),
    "torque_ripple": LawInfo("motor", {"amplitude": "Nm", "order": "-", "phase": "rad"}),
    "torque_offset": LawInfo("motor", {"offset": "Nm"}),
    "torque_gain": LawInfo("sensing", {"gain_error": "-"}),
    "torque_delay": LawInfo("sensing", {"delay": "s"}, "set"),
    "stiffness_hardening": LawInfo("joint", {"cubic_stiffness": "Nm/rad³"}),
    "backlash": LawInfo("joint", {"half_width": "rad"}),
    "joint_damping": LawInfo("joint", {"damping": "Nm s/rad"}),
    "transmission_error": LawInfo("joint", {"amplitude": "rad", "order": "-", "phase": "rad"}),
    "link_coulomb_friction": LawInfo("link", {"coulomb": "Nm"}),
    "cable_spring": LawInfo("link", {"stiffness": "Nm/rad", "rest_angle": "rad"}),
    "payload_error": LawInfo("load", {"relative_mass_error": "-"}, "payload"),
    "base_tilt": LawInfo("load", {"tilt_x": "rad", "tilt_y": "rad"}, "set"),
    "external_contact": LawInfo("load", {"torque": "Nm", "start": "s", "end": "s"}),
    "motor_coupling": LawInfo("motor", {"inertia": "kg m²"}),
}


def coulomb_friction(coulomb: float) -> MotorLaw:
    """f_c sign(θ̇)"""
    return lambda t, theta, velocity, load: coulomb * tanh(velocity / SIGN_WIDTH)


def stribeck_friction(stribeck: float, velocity: float) -> MotorLaw:
    """f_s exp(−(θ̇/v_s)²) sign(θ̇)"""
    v_s = velocity
    return lambda t, theta, velocity, load: (
        stribeck * exp(-((velocity / v_s) ** 2)) * tanh(velocity / SIGN_WIDTH)
    )


def quadratic_friction(quadratic: float) -> MotorLaw:
    """f_q θ̇ |θ̇|"""
    return lambda t, theta, velocity, load: quadratic * velocity * abs(velocity)


def load_dependent_friction(coefficient: float) -> MotorLaw:
    """μ |τ_j| sign(θ̇)"""
    return lambda t, theta, velocity, load: coefficient * abs(load) * tanh(velocity / SIGN_WIDTH)


def friction_drift(relative_rise: float, time_constant: float, viscous: float) -> MotorLaw:
    """f_mv θ̇ · a exp(−t/T), t the group's own time"""
    rise = relative_rise * viscous
    return lambda t, theta, velocity, load: rise * velocity * exp(-t / time_constant)


def torque_ripple(amplitude: float, order: float, phase: float) -> MotorLaw:
    """a sin(nθ + φ)"""
    return lambda t, theta, velocity, load: amplitude * sin(order * theta + phase)


def torque_offset(offset: float) -> MotorLaw:
    """f_0"""
    return lambda t, theta, velocity, load: offset


def link_coulomb_friction(coulomb: float) -> LinkLaw:
    """f_c sign(q̇)"""
    return lambda t, q, velocity: coulomb * tanh(velocity / SIGN_WIDTH)


def cable_spring(stiffness: float, rest_angle: float) -> LinkLaw:
    """k_c (q − q₀)"""
    return lambda t, q, velocity: stiffness * (q - rest_angle)


MOTOR_LAWS: dict[str, Callable[..., MotorLaw]] = {
    "coulomb_friction": coulomb_friction,
    "stribeck_friction": stribeck_friction,
    "quadratic_friction": quadratic_friction,
    "load_dependent_friction": load_dependent_friction,
    "friction_drift": friction_drift,
    "torque_ripple": torque_ripple,
    "torque_offset": torque_offset,
}
LINK_LAWS: dict[str, Callable[..., LinkLaw]] = {
    "link_coulomb_friction": link_coulomb_friction,
    "cable_spring": cable_spring,
}


@dataclass(frozen=True)
class Dahl:
    """Presliding hysteresis: friction σz with ż = θ̇ − |θ̇| z σ/f_c; z [rad] is a state of the simulation."""

    presliding_stiffness: float  # σ [Nm/rad]
    coulomb: float  # f_c [Nm]

    def torque(self, z: float) -> float:
        """σ z [Nm]"""
        return self.presliding_stiffness * z

    def rate(self, z: float, velocity: float) -> float:
        """ż [rad/s]"""
        return velocity - abs(velocity) * z * self.presliding_stiffness / self.coulomb
