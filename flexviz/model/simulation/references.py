"""Reference motions θ_d(t) of the motor side, with their velocities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from flexviz.model.simulation.plant import Array
from flexviz.robot.robot import Robot


class Reference(ABC):
    """A motion θ_d(t), in the set's joint order."""

    @abstractmethod
    def sample(self, time: Array) -> tuple[Array, Array]:
        """Position (N, n) [rad] and velocity (N, n) [rad/s] at `time` (N,) [s]."""


@dataclass(frozen=True)
class Sinusoid(Reference):
    """The paper's θ_d = k1 − k1 sin(k2 t): its velocity jumps when it starts at rest.

    Attributes:
        amplitude: k1 [rad].
        frequency: k2 [rad/s].
        n: number of joints; all have the same motion.
    """

    amplitude: float
    frequency: float
    n: int = 2

    def sample(self, time: Array) -> tuple[Array, Array]:
        phase = self.frequency * np.asarray(time)
        position = self.amplitude * (1.0 - np.sin(phase))
        velocity = -self.amplitude * self.frequency * np.cos(phase)
        return np.repeat(position[:, None], self.n, axis=1), np.repeat(velocity[:, None], self.n, axis=1)


@dataclass(frozen=True, eq=False)
class Fourier(Reference):
    """θ_d = centre + s(t) Σ_k [a_k sin(kωt) + b_k cos(kωt)], s rising smoothly from 0 to 1 during `ramp`.

    Attributes:
        centre: (n,) [rad].
        sine, cosine: (n, H) coefficients a_k, b_k [rad].
        frequency: ω [rad/s].
        ramp: [s].
        end: when s has fallen to 0 again, as smoothly as it rose [s]; None: never.
    """

    centre: Array
    sine: Array
    cosine: Array
    frequency: float
    ramp: float = 1.0
    end: float | None = None

    def sample(self, time: Array) -> tuple[Array, Array]:
        t = np.asarray(time, dtype=float)
        k = np.arange(1, self.sine.shape[1] + 1)
        angle = self.frequency * t[:, None] * k  # (N, H)
        sin, cos, rate = np.sin(angle), np.cos(angle), self.frequency * k
        series = sin @ self.sine.T + cos @ self.cosine.T
        slope = (cos * rate) @ self.sine.T - (sin * rate) @ self.cosine.T
        rise, rise_rate = self._rise(t)
        if self.end is not None:
            fall, fall_rate = self._rise(self.end - t)
            rise, rise_rate = rise * fall, rise_rate * fall - rise * fall_rate
        return self.centre + rise * series, rise * slope + rise_rate * series

    def _rise(self, t: Array) -> tuple[Array, Array]:
        """s and its rate, (N, 1) each, at `t` (N,) [s]."""
        u = np.clip(t / self.ramp, 0.0, 1.0)[:, None]
        rise = u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)
        return rise, 140.0 * u**3 * (1.0 - u) ** 3 / self.ramp


@dataclass(frozen=True, eq=False)
class Sampled(Reference):
    """A recorded motion as a cubic spline; smoothly extrapolated before its start, at rest after its end."""

    time: Array
    position: Array

    def sample(self, time: Array) -> tuple[Array, Array]:
        spline = CubicSpline(self.time, self.position, axis=0, bc_type="not-a-knot")
        t = np.clip(time, self.time[0], self.time[-1])
        early = np.minimum(np.asarray(time) - self.time[0], 0.0)[:, None]  # [s] time before the first sample
        late = (np.asarray(time) > self.time[-1])[:, None]
        position, velocity, acceleration = spline(t), spline(t, 1), spline(self.time[0], 2)
        position = position + velocity * early + 0.5 * acceleration * early**2
        return position, np.where(late, 0.0, velocity + acceleration * early)


def random_fourier(
    robot: Robot,
    seed: int,
    *,
    centre: ArrayLike,
    reach: ArrayLike,
    duration: float,
    harmonics: int = 5,
    frequency: float | None = None,
    speed: float = 0.7,
    margin: float = 0.05,
) -> Fourier:
    """A random Fourier series around `centre` (n,) that moves each joint by up to `reach` (n,) [rad].

    It stays `margin` [rad] inside the joint limits and below `speed` times the velocity limits. `frequency`
    [rad/s] is the base frequency; None: twice in `duration`.
    """
    rng = np.random.default_rng(seed)
    middle = np.broadcast_to(np.asarray(centre, dtype=float), (robot.n,)).copy()
    room = np.minimum(middle - robot.lower_limit, robot.upper_limit - middle) - margin
    reach = np.minimum(np.broadcast_to(np.asarray(reach, dtype=float), (robot.n,)), np.maximum(room, 0.0))
    base = 2.0 * np.pi * 2.0 / duration if frequency is None else frequency
    weight = 1.0 / np.sqrt(np.arange(1, harmonics + 1))
    sine, cosine = rng.standard_normal((2, robot.n, harmonics)) * weight
    t = np.linspace(0.0, duration, 4000)
    raw = Fourier(np.zeros(robot.n), sine, cosine, base)
    position, velocity = raw.sample(t)
    limit = np.where(robot.velocity_limit > 0, robot.velocity_limit, np.inf)
    scale = np.minimum(reach / np.abs(position).max(axis=0), speed * limit / np.abs(velocity).max(axis=0))
    return Fourier(middle, sine * scale[:, None], cosine * scale[:, None], base)
