"""Rigid-body terms of an earlier, nearly equal motion, for a Jacobian that may be approximate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.equation.link import LinkTerms

# changes up to which a Jacobian may be that of other rigid-body terms:
NEAR_ANGLE = 0.02  # of the pose [rad]
NEAR_MOTION = 0.1  # of velocities, accelerations and torques, relative to their largest


@dataclass(frozen=True, eq=False)
class RigidTerms:
    """Rigid-body terms of one motion of the link side.

    Attributes:
        inertial: shape (10n,), parameters of the bodies without payload.
        q: shape (3, N, n), the motion.
        regressor: shape (N, n, 10n), Y(q, q̇, q̈).
        link: derivatives of Y Γ.
    """

    inertial: Array
    q: Array
    regressor: Array
    link: LinkTerms


class NearbyTerms:
    """The rigid-body terms of the last motion that was kept."""

    def __init__(self) -> None:
        self._known: RigidTerms | None = None

    def keep(self, inertial: Array, q: Array, regressor: Array, link: LinkTerms) -> None:
        """Keep the terms of a motion q (3, N, n) of bodies (10n,), regressor (N, n, 10n)."""
        self._known = RigidTerms(inertial.copy(), q.copy(), regressor.copy(), link)

    def near(self, inertial: Array, q: Array) -> RigidTerms | None:
        """The kept terms, if pose, motion q (3, N, n) and torques of bodies (10n,) are nearly the same."""
        known = self._known
        if known is None or np.abs(q[0] - known.q[0]).max() > NEAR_ANGLE:
            return None
        largest = np.abs(known.q[1:]).max(axis=(1, 2), keepdims=True) + 1e-12
        if np.any(np.abs(q[1:] - known.q[1:]) > NEAR_MOTION * largest):
            return None
        torque, moved = (known.regressor @ p for p in (known.inertial, inertial - known.inertial))
        return None if np.any(np.std(moved, axis=0) > NEAR_MOTION * np.std(torque, axis=0) + 1e-12) else known
