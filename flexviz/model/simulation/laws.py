"""The effects' laws in the simulator, one function each, in joint-side units.

They deliberately duplicate the laws in `flexviz.model.effects`: simulated truth and estimator share no code.

A *motor* law gives a torque that opposes the motor:   f(t, θ, θ̇, τ_j) [Nm]
A *link* law gives a torque that opposes the link:     f(t, q, q̇) [Nm]
A *coupled* law gives a torque that opposes two motors, by their velocities: f(θ̇_i, θ̇_j) [Nm]
sign(v) is tanh(v / 0.005 rad/s).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import asinh, cos, exp, sin, tanh
from typing import ClassVar, NamedTuple

import numpy as np

from flexviz.model.effects import Effect, JointState

SIGN_WIDTH = 0.005  # [rad/s]
REST_SPEED = 0.005  # [rad/s] below which start-up friction returns ...
REST_TIME = 0.1  # [s] ... within this time
ROOM_TEMPERATURE = 20.0  # [°C] of a run that states none

MotorLaw = Callable[[float, float, float, float], float]
LinkLaw = Callable[[float, float, float], float]
CoupledLaw = Callable[[float, float], float]


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


def directional_friction(directional: float) -> MotorLaw:
    """f_d |θ̇|"""
    return lambda t, theta, velocity, load: directional * abs(velocity)


def thinning_friction(thinning: float, velocity: float) -> MotorLaw:
    """f_t asinh(θ̇/v_t)"""
    v_t = velocity
    return lambda t, theta, velocity, load: thinning * asinh(velocity / v_t)


def load_dependent_friction(coefficient: float) -> MotorLaw:
    """μ |τ_j| sign(θ̇)"""
    return lambda t, theta, velocity, load: coefficient * abs(load) * tanh(velocity / SIGN_WIDTH)


def driving_friction(motor_driving: float, load_driving: float) -> MotorLaw:
    """μ |τ_j| sign(θ̇), with μ_m where the power τ_j θ̇ flows to the load, μ_l where it flows back"""

    def torque(t: float, theta: float, velocity: float, load: float) -> float:
        forth = abs(load) * tanh(velocity / SIGN_WIDTH)
        return (motor_driving if load * velocity > 0.0 else load_driving) * forth

    return torque


def friction_drift(relative_rise: float, time_constant: float, viscous: float) -> MotorLaw:
    """f_mv θ̇ · a exp(−t/T), t the group's own time"""
    rise = relative_rise * viscous
    return lambda t, theta, velocity, load: rise * velocity * exp(-t / time_constant)


def temperature_friction(viscous_fall: float, coulomb_fall: float, temperature: float) -> MotorLaw:
    """(20 °C − T) a_v θ̇ + (20 °C − T) a_c sign(θ̇)"""
    viscous = viscous_fall * (ROOM_TEMPERATURE - temperature)
    coulomb = coulomb_fall * (ROOM_TEMPERATURE - temperature)
    return lambda t, theta, velocity, load: viscous * velocity + coulomb * tanh(velocity / SIGN_WIDTH)


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


def gravity_compensator(sine: float, cosine: float) -> LinkLaw:
    """a sin q + b cos q"""
    return lambda t, q, velocity: sine * sin(q) + cosine * cos(q)


def coupled_friction(coulomb: float, viscous: float) -> CoupledLaw:
    """f_c sign(θ̇_i + θ̇_j) + f_v (θ̇_i + θ̇_j)"""
    return lambda own, other: coulomb * tanh((own + other) / SIGN_WIDTH) + viscous * (own + other)


@dataclass
class ElasticJoint:
    """One joint's elastic law with all joint effects; zero switches an effect off.

    x = deadzone(θ + a sin(nθ + φ) − q, b), τ_j = K x + k₃ x³ + D ẋ. The motor equation keeps τ_j: what the
    transmission error does to the motor is neglected.
    """

    stiffness: float  # K [Nm/rad]
    cubic: float = 0.0  # k₃ [Nm/rad³]
    half_width: float = 0.0  # backlash b [rad]
    damping: float = 0.0  # D [Nm s/rad]
    # transmission errors (amplitude [rad], order [-], phase [rad])
    errors: tuple[tuple[float, float, float], ...] = ()

    def torque(self, theta: float, q: float, theta_velocity: float, q_velocity: float) -> float:
        """τ_j [Nm]"""
        x = theta - q
        speed = theta_velocity
        for amplitude, order, phase in self.errors:
            x += amplitude * sin(order * theta + phase)
            speed += amplitude * order * cos(order * theta + phase) * theta_velocity
        b = self.half_width
        if -b < x < b:
            return 0.0  # inside the gap
        if b:
            x -= b if x > 0 else -b
        return self.stiffness * x + self.cubic * x * x * x + self.damping * (speed - q_velocity)

    def shift(self, theta: float) -> float:
        """Transmission error at θ [rad]."""
        return sum(a * sin(n * theta + phase) for a, n, phase in self.errors)

    def opening(self, torque: float) -> float:
        """The δ = θ + error − q at which the joint at rest carries `torque` [Nm]."""
        k, k3 = self.stiffness, self.cubic
        x = torque / k
        if k3:
            for _ in range(60):
                step = (k * x + k3 * x**3 - torque) / max(k + 3 * k3 * x * x, 1e-3 * k)
                x -= step
                if abs(step) < 1e-15:
                    break
        if self.half_width and torque:
            x += self.half_width if torque > 0 else -self.half_width
        return x

    def tangent(self, torque: float) -> float:
        """dτ_j/dδ where the joint carries about `torque` [Nm/rad]."""
        x = torque / self.stiffness
        return self.stiffness + 3 * max(self.cubic, 0.0) * x * x


class Pull(NamedTuple):
    """Torques of a law on its joint.

    Attributes:
        motor, link: torques opposing the motor and the link [Nm].
        joint: additional joint torque [Nm].
        rates: time derivatives of the law's states.
    """

    motor: float = 0.0
    link: float = 0.0
    joint: float = 0.0
    rates: Sequence[float] = ()


class ExtraLaw(ABC):
    """A law on one joint, smooth over an integration step.

    Attributes:
        states: number of its states, which start at zero.
    """

    states: ClassVar[int] = 0

    @abstractmethod
    def pull(self, at: JointState) -> Pull:
        """Its torques at one instant, and the rates of its states."""


@dataclass(frozen=True)
class Dahl(ExtraLaw):
    """Presliding hysteresis: friction σz with ż = θ̇ − |θ̇| z σ/f_c, z in rad."""

    presliding_stiffness: float  # σ [Nm/rad]
    coulomb: float  # f_c [Nm]
    states = 1

    def pull(self, at: JointState) -> Pull:
        """σ z on the motor [Nm], and ż [rad/s]."""
        z, velocity = at.z[0], at.theta_velocity
        rate = velocity - abs(velocity) * z * self.presliding_stiffness / self.coulomb
        return Pull(motor=self.presliding_stiffness * z, rates=(rate,))


@dataclass(frozen=True)
class BreakAway(ExtraLaw):
    """f_s (1 − y) sign(θ̇); the worn-off part y grows with the path and returns to zero at rest."""

    startup: float  # f_s [Nm]
    angle: float  # x_s [rad]
    states = 1

    def pull(self, at: JointState) -> Pull:
        """Torque on the motor [Nm], and ẏ = (1 − y) |θ̇|/x_s − y exp(−(θ̇/v)²)/T [1/s]."""
        speed, worn = at.theta_velocity, at.z[0]
        healing = exp(-((speed / REST_SPEED) ** 2)) / REST_TIME
        rate = (1.0 - worn) * abs(speed) / self.angle - worn * healing
        return Pull(motor=self.startup * (1.0 - worn) * tanh(speed / SIGN_WIDTH), rates=(rate,))


class UserEffectLaw(ExtraLaw):
    """The torque of a user-defined effect, on the side where the effect acts."""

    def __init__(self, where: str, torque: Callable[[JointState], float]) -> None:
        self._where, self._torque = where, torque

    @staticmethod
    def of(effect: Effect, parameters: Mapping[str, float]) -> UserEffectLaw:
        """The law of an effect that can be simulated, with these parameters."""
        torque = effect.simulation(np.array([parameters[p.name] for p in effect.parameters]))
        assert torque is not None
        return UserEffectLaw(effect.where, torque)

    def pull(self, at: JointState) -> Pull:
        torque = float(self._torque(at))
        if self._where == "motor":
            return Pull(motor=torque)
        return Pull(link=torque) if self._where == "link" else Pull(joint=torque)
