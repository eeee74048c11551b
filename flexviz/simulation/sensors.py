"""What the sensors make of the true motion: quantised and noisy positions, noisy torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexviz.simulation.plant import Array


@dataclass(frozen=True)
class Sensors:
    """Noise and resolution, one number or one a joint.

    Attributes
    ----------
    theta_noise: standard deviation of the motor position's noise [rad].
    torque_noise: standard deviation of the torque's noise [Nm].
    resolution: smallest step of the motor encoder at the joint side [rad]; 0: none.
    feedback: False: noise and resolution are in the record only; True: the controller sees them too.
    velocity_filter: with `feedback`, bandwidth of the low-pass on the differenced position [rad/s].
    """

    theta_noise: ArrayLike = 0.0
    torque_noise: ArrayLike = 0.0
    resolution: ArrayLike = 0.0
    feedback: bool = False
    velocity_filter: float = 1000.0

    def noise(self, samples: int, n: int, seed: int | np.random.Generator | None) -> tuple[Array, Array]:
        """Noise of θ (N, n) [rad] and of τ (N, n) [Nm]."""
        rng = np.random.default_rng(seed)
        return (
            rng.standard_normal((samples, n)) * np.asarray(self.theta_noise, dtype=float),
            rng.standard_normal((samples, n)) * np.asarray(self.torque_noise, dtype=float),
        )

    def quantise(self, theta: Array) -> Array:
        """θ (…, n) rounded to the encoder's steps."""
        step = np.broadcast_to(np.asarray(self.resolution, dtype=float), theta.shape[-1:])
        if not step.any():
            return theta
        safe = np.where(step > 0, step, 1.0)
        return np.where(step > 0, np.round(theta / safe) * safe, theta)
