"""Closed-form synthetic motion as a context of effects, for checks and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from flexviz.base.arrays import Bools
from flexviz.model.effects.terms import Array, JointMotion
from flexviz.robot.mounting import GRAVITY


@dataclass(frozen=True)
class TrialSignal:
    """constant + slope·t + Σ a sin(ωt + φ), with exact derivatives."""

    waves: tuple[tuple[float, float, float], ...] = ()  # (a, ω [rad/s], φ [rad]) of each sine
    constant: float = 0.0
    slope: float = 0.0

    def at(self, time: Array, depth: int) -> Array:
        """The signal and its derivatives at `time` (N,): shape (depth, N)."""
        out = np.zeros((depth, len(time)))
        out[0] = self.constant + self.slope * time
        if depth > 1:
            out[1] = self.slope
        for size, omega, phase in self.waves:
            for k in range(depth):
                out[k] += size * omega**k * np.sin(omega * time + phase + k * np.pi / 2)
        return out


@dataclass(frozen=True)
class TrialMotion:
    """A `Context` with closed-form signals: two joints, one group, no filter.

    Payload and gravity torques are those of a pendulum that turns from the base's x towards its z.
    """

    time: Array  # (N,) [s]
    motor: TrialSignal  # θ of joint 0 [rad]
    # τ, and the transmission torque s, of joint 0 [Nm]
    torque: TrialSignal = field(default_factory=TrialSignal)
    neighbour: TrialSignal = field(default_factory=TrialSignal)  # θ of joint 1 [rad]
    # stiffness, motor_viscous: [Nm/rad], [Nm s/rad]
    stiffness: float = 5000.0
    motor_viscous: float = 2.0
    temperature: float = 35.0  # of the joints [°C]
    # arm, payload: weight moments of arm and payload, mass × distance [kg m]
    arm: float = 4.0
    payload: float = 1.5

    def motions(self, joint: int) -> Sequence[JointMotion]:
        (theta, speed), torque = self.theta(joint)[:2], self.torque.at(self.time, 1)[0]
        q, link_speed = self.link_state(joint)[:2]
        scale = float(np.sqrt(np.mean(torque**2))) + 1e-12
        return [
            JointMotion(
                time=self.time,
                position=theta,
                velocity=speed,
                torque=torque,
                link_position=q,
                link_velocity=link_speed,
                stiffness=self.stiffness,
                motor_viscous=self.motor_viscous,
                torque_scale=scale,
                temperature=self.temperature,
            )
        ]

    def once(self, key: tuple[object, ...], make: Callable[[], Array]) -> Array:
        return make()

    def decimation(self, joint: int, depth: int, highest: float) -> list[int]:
        return [1]

    def filtered(
        self, parts: Sequence[Array], joint: int, depth: int, every: Sequence[int] | None = None
    ) -> Array:
        """The columns themselves; their derivatives by differences."""
        levels = [np.asarray(parts[0], dtype=float)]
        for _ in range(depth - 1):
            levels.append(np.gradient(levels[-1], self.time, axis=1))
        return np.stack(levels, axis=1)

    def theta(self, joint: int) -> Array:
        return (self.motor, self.neighbour)[joint].at(self.time, 5)

    def tau(self, joint: int) -> Array:
        return self.delayed_tau(joint, 0.0)

    def delayed_tau(self, joint: int, delay: float) -> Array:
        return self.torque.at(self.time - delay, 4)

    def of_torque(self, joint: int, law: Callable[[Array], Array]) -> Array:
        return self.filtered([law(self.torque.at(self.time, 1)[0])], joint, 3)

    def link_state(self, joint: int) -> Array:
        return self.theta(joint)[:3] - self.torque.at(self.time, 3) / self.stiffness

    def in_group(self, group: str) -> Bools:
        return np.ones(len(self.time), dtype=bool)

    def payload_torque(self, payload: str) -> Array:
        return self._both(9.81 * self.payload * np.cos(self.link_state(0)[0]))

    def gravity_torque(self, axis: int) -> Array:
        angle = self.link_state(0)[0]
        return self._both(self.arm * (np.sin(angle), np.zeros_like(angle), -np.cos(angle))[axis])

    def gravity(self) -> Array:
        return np.array(GRAVITY)

    def count(self) -> int:
        return len(self.time)

    def joints(self) -> int:
        return 2

    def _both(self, torque: Array) -> Array:
        return np.stack((torque, np.zeros_like(torque)), axis=1)
