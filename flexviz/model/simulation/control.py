"""Sampled PD controller on the motor side with an optional torque filter."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from scipy.linalg import expm

from flexviz.model.simulation.plant import Array


@dataclass(frozen=True, eq=False)
class PDController:
    """τ = k_p (θ_d − θ) + k_d (θ̇_d − θ̇), computed once per cycle and held.

    Attributes:
        kp, kd: (n,), or one number for all joints [Nm/rad], [Nm s/rad].
        cycle: [s].
        torque_filter: bandwidth of a 6th-order ESO that filters applied and recorded torque [rad/s], or None.
    """

    kp: Any
    kd: Any
    cycle: float
    torque_filter: float | None = None


class TorqueFilter:
    """First state of a 6th-order linear ESO with all poles at −w, discretised exactly for held input.

    x̂̇_i = x̂_{i+1} + β_i (u − x̂₁),  β_i = C(6, i) wⁱ; the states are kept scaled by wⁱ.
    """

    def __init__(self, bandwidth: float, cycle: float, start: Array) -> None:
        gain = [comb(6, i) for i in range(1, 7)]
        a = np.zeros((7, 7))
        a[:6, :6] = np.eye(6, k=1)
        a[:6, 0] -= gain
        a[:6, 6] = gain  # of the input
        exact = expm(a * bandwidth * cycle)
        self._a, self._b = exact[:6, :6].copy(), exact[:6, 6:].copy()
        self._state = np.zeros((6, len(start)))
        self._state[0] = start

    def __call__(self, torque: Array) -> Array:
        """The smoothed torque (n,) after one more cycle with `torque` (n,) at the input."""
        self._state = self._a @ self._state + self._b * torque
        return self._state[0]
