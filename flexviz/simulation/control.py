"""Sampled PD controller on the motor side with an optional torque filter."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from flexviz.simulation.plant import Array


@dataclass(frozen=True, eq=False)
class PDController:
    """τ = k_p (θ_d − θ) + k_d (θ̇_d − θ̇), computed once per cycle and held.

    Attributes:
        kp: (n,) [Nm/rad].
        kd: (n,) [Nm s/rad].
        cycle: [s].
        torque_filter: bandwidth of a 6th-order ESO that filters applied and recorded torque [rad/s], or None.
    """

    kp: Array
    kd: Array
    cycle: float
    torque_filter: float | None = None

    def __init__(
        self, kp: ArrayLike, kd: ArrayLike, cycle: float, torque_filter: float | None = None
    ) -> None:
        object.__setattr__(self, "kp", np.array(kp, dtype=float))
        object.__setattr__(self, "kd", np.array(kd, dtype=float))
        object.__setattr__(self, "cycle", float(cycle))
        object.__setattr__(self, "torque_filter", torque_filter)


class TorqueFilter:
    """First state of a 6th-order linear ESO with all poles at −w, discretised exactly for held input.

    x̂̇_i = x̂_{i+1} + β_i (u − x̂₁),  β_i = C(6, i) wⁱ; the states are kept scaled by wⁱ.
    """

    def __init__(self, bandwidth: float, cycle: float, start: Array) -> None:
        a = np.zeros((7, 7))
        for i in range(6):
            gain = comb(6, i + 1)
            a[i, 0] -= gain
            a[i, 6] = gain  # input column
            if i < 5:
                a[i, i + 1] += 1.0
        exact = expm(a * bandwidth * cycle)
        self._a, self._b = exact[:6, :6].copy(), exact[:6, 6:].copy()
        self._state = np.zeros((6, len(start)))
        self._state[0] = start

    def __call__(self, torque: Array) -> Array:
        """The smoothed torque (n,) after one more cycle with `torque` (n,) at the input."""
        self._state = self._a @ self._state + self._b * torque
        return self._state[0]
