"""Sensor models: torque filter, noise and quantisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from flexviz.model.simulation.plant import Array

Seed = int | np.random.Generator | None  # of random numbers; None: different ones each time


@dataclass(frozen=True)
class Sensors:
    """Noise and resolution, one number for all joints or one per joint.

    Attributes:
        theta_noise: standard deviation of the motor position's noise [rad].
        torque_noise: standard deviation of the torque's noise [Nm].
        resolution: smallest step of the motor encoder at the joint side [rad]; 0: none.
        torque_resolution: smallest step of the recorded torque [Nm]; 0: none.
        torque_filter: bandwidth of the first-order low-pass in the torque's record, as of a measured motor
            current [rad/s]; 0: none.
        feedback: noise and resolution also affect the controller, not only the record.
        velocity_filter: with `feedback`, bandwidth of the low-pass on the differenced position [rad/s].
    """

    theta_noise: ArrayLike = 0.0
    torque_noise: ArrayLike = 0.0
    resolution: ArrayLike = 0.0
    torque_resolution: ArrayLike = 0.0
    torque_filter: float = 0.0
    feedback: bool = False
    velocity_filter: float = 1000.0

    def reordered(self, permute: Callable[[Array], Array], n: int) -> Sensors:
        """The same sensors with the joints in another order."""
        names = ("theta_noise", "torque_noise", "resolution", "torque_resolution")
        values = {k: np.broadcast_to(np.asarray(getattr(self, k), dtype=float), n) for k in names}
        return replace(self, **{k: permute(v) for k, v in values.items()})

    def noise(self, samples: int, n: int, seed: Seed) -> tuple[Array, Array]:
        """Noise of θ (N, n) [rad] and of τ (N, n) [Nm]."""
        rng = np.random.default_rng(seed)
        sizes = (np.asarray(size, dtype=float) for size in (self.theta_noise, self.torque_noise))
        theta, torque = (rng.standard_normal((samples, n)) * size for size in sizes)
        return theta, torque

    def filtered(self, torque: Array, cycle: float) -> Array:
        """The torques (N, n) of all cycles, each held for `cycle` [s], as seen at the start of each cycle.

        Exact: y ← y + (1 − exp(−w cycle)) (τ − y); the torque was constant before.
        """
        if not self.torque_filter:
            return torque
        blend = -np.expm1(-self.torque_filter * cycle)
        return lfilter([0.0, blend], [1.0, blend - 1.0], torque, axis=0, zi=torque[:1])[0]


def rounded(values: Array, resolution: ArrayLike) -> Array:
    """Values (…, n) rounded to steps of `resolution`, unless that is 0."""
    step = np.broadcast_to(np.asarray(resolution, dtype=float), values.shape[-1:])
    if not step.any():
        return values
    safe = np.where(step > 0, step, 1.0)
    return np.where(step > 0, np.round(values / safe) * safe, values)


class Feedback:
    """Measured position and filtered velocity for the controller."""

    def __init__(
        self, sensors: Sensors, cycles: int, cycle: float, theta: Array, speed: Array, seed: Seed
    ) -> None:
        self.sensors = sensors
        self.noise, self.torque_noise = sensors.noise(cycles, len(theta), seed)
        self._last = rounded(theta + self.noise[0], sensors.resolution)
        self._speed = speed.copy()
        self._blend = -np.expm1(-sensors.velocity_filter * cycle)
        self._cycle = cycle

    def __call__(self, k: int, theta: Array) -> tuple[Array, Array]:
        seen = rounded(theta + self.noise[k], self.sensors.resolution)
        if k:
            self._speed = self._speed + self._blend * ((seen - self._last) / self._cycle - self._speed)
        self._last = seen
        return seen, self._speed
