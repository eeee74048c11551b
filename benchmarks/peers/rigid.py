"""A rigid robot with motor inertia, viscous and Coulomb friction and offsets: linear in its parameters.

τ = Y(q, q̇, q̈) (Γ + Γ_payload) + B q̈ + f_v q̇ + f_c sign(q̇) + f_0, the model of IDIM-LS, IDIM-IV and DIDIM.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pinocchio
from scipy.linalg import qr

from benchmarks.peers.problem import COULOMB, OFFSET, Array, Group, Indices, Problem, answer

pin: Any = pinocchio
WEAK = 1e-3  # share of the largest eigenvalue below which a direction keeps its value in the URDF
SMOOTH = 0.005  # [rad/s] sign(v) as tanh(v / SMOOTH)


class RigidModel:
    """The parameters x are [Γ (10n), B (n), f_v (n), f_c (n), f_0 (n)], as far as they are in the model."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.n = problem, problem.n
        self.pin = pin.buildModelFromUrdf(str(problem.urdf))
        self.data = self.pin.createData()
        zeros = [np.zeros(self.n)] * sum(name in problem.effects for name in (COULOMB, OFFSET))
        friction = np.full(self.n, 0.1)
        self.start = np.concatenate([problem.inertial.ravel(), problem.motor_inertia, friction, *zeros])
        self.base = self._base()

    def regressor(self, q: Array, v: Array, a: Array) -> Array:
        """(N, n, P) of N states."""
        states = zip(q, v, a, strict=True)
        links = [pin.computeJointTorqueRegressor(self.pin, self.data, *row).copy() for row in states]
        columns = [a, v]
        if COULOMB in self.problem.effects:
            columns.append(np.tanh(v / SMOOTH))
        if OFFSET in self.problem.effects:
            columns.append(np.ones_like(v))
        diagonals = [column[:, :, None] * np.eye(self.n) for column in columns]
        return np.concatenate([np.array(links), *diagonals], axis=2)

    def payload_torque(self, group: Group, regressor: Array) -> Array:
        """(N, n) of the group's known payload [Nm]."""
        return np.asarray(regressor[:, :, : 10 * self.n] @ group.payload.ravel())

    def _base(self) -> Indices:
        """Columns of a largest independent subset, by QR with pivoting at random states."""
        rng = np.random.default_rng(0)
        y = self.regressor(*rng.uniform(-2.5, 2.5, (3, 20 * self.n, self.n)))
        y = y.reshape(-1, y.shape[2])
        size = np.linalg.norm(y, axis=0)
        y = np.where(size > 1e-6 * size.max(), y / np.maximum(size, 1e-300), 0.0)  # no rounding errors
        _, r, order = cast(Any, qr(y, mode="economic", pivoting=True))
        rank = int((np.abs(np.diag(r)) > 1e-6 * abs(r[0, 0])).sum())
        return np.sort(order[:rank])

    def solve(self, y: Array, tau: Array, instruments: Array | None = None) -> Array:
        """x from τ = y x (N, n, P), joints weighted by their residual; by instruments of y's shape if given.

        The parameters outside the base keep their values in the URDF.
        """
        z = y if instruments is None else instruments
        rest = tau - y @ self.start
        y, z = y[:, :, self.base], z[:, :, self.base]
        sigma = tau.std(axis=0)
        step = np.zeros(len(self.base))
        for _ in range(3):
            left = (z / sigma[:, None]).reshape(-1, len(self.base))
            right = (y / sigma[:, None]).reshape(-1, len(self.base))
            scale = np.linalg.norm(right, axis=0)
            scale = np.maximum(scale, 1e-6 * scale.max())  # a column that this motion does not show
            matrix, vector = (left / scale).T @ (right / scale), (left / scale).T @ (rest / sigma).ravel()
            step = np.linalg.lstsq(matrix, vector, rcond=WEAK)[0] / scale
            sigma = (rest - y @ step).std(axis=0)
        x = self.start.copy()
        x[self.base] += step
        return x

    def answer(self, x: Array, evaluations: int, converged: bool = True) -> dict[str, Any]:
        """The parameters by name."""
        n = self.n
        motor, viscous, *rest = x[10 * n :].reshape(-1, n)
        names = [name for name in (COULOMB, OFFSET) if name in self.problem.effects]
        named = dict(zip(names, rest, strict=True))
        return answer(
            self.problem,
            stiffness=None,
            motor_inertia=motor,
            viscous=(np.zeros(n), viscous),
            inertial=x[: 10 * n].reshape(n, 10),
            coulomb=named.get(COULOMB),
            offset=named.get(OFFSET),
            evaluations=evaluations,
            converged=converged,
        )
