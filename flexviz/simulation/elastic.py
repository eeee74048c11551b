"""The elastic joint's law with all joint effects.

    x   = deadzone(θ + a sin(nθ + φ) − q, b)          elastic deflection
    τ_j = K x + k₃ x³ + D ẋ                            joint torque

The motor equation keeps τ_j: the reaction of the transmission error on the motor is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin


@dataclass
class ElasticJoint:
    """One joint's elastic law; zero switches an effect off."""

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
