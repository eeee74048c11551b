"""Rigid-body terms of the link side at many samples, by Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz._pinocchio import pin
from flexviz.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinkTerms:
    """Derivatives of Y(q, q̇, q̈) Γ at N samples, in the set's joint order.

    Attributes:
        dq: shape (N, n, n), ∂(YΓ)/∂q [Nm/rad].
        dv: shape (N, n, n), ∂(YΓ)/∂q̇ [Nm s/rad].
        mass: shape (N, n, n), M(q) [kg m²].
        torque: shape (N, n), transmission torque of the joints [Nm]; None if it is not known.
        seen: shape (n,) [rad/s], band in which effects see that torque, beside the observer's; None for all
            frequencies.
    """

    dq: Array
    dv: Array
    mass: Array
    torque: Array | None = None
    seen: Array | None = None

    def rows(self, rows: slice) -> LinkTerms:
        """The same at some of the samples."""
        torque = None if self.torque is None else self.torque[rows]
        return LinkTerms(self.dq[rows], self.dv[rows], self.mass[rows], torque, self.seen)


class LinkDynamics:
    """Evaluates Y(q, q̇, q̈) and the derivatives of Y Γ."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._model = robot.model.copy()
        self._data = self._model.createData()
        self._order = robot.order
        self._sorted = bool(np.array_equal(robot.order, np.arange(robot.n)))
        self._columns = (10 * robot.order[:, None] + np.arange(10)).ravel()

    def evaluate(
        self,
        blocks: Sequence[tuple[slice, Array]],
        q: Array,
        v: Array,
        a: Array,
        regressor: Array | None = None,
        gravity: Array | None = None,
    ) -> LinkTerms:
        """All terms.

        Args:
            blocks: samples and their inertial parameters, payload included, shape (n, 10); a body's mass is
                positive.
            q, v, a: shape (N, n) [rad, rad/s, rad/s²].
            regressor: shape (N, n, 10n), where to write Y(q, q̇, q̈); None: it is not computed.
            gravity: shape (3,), acceleration of gravity [m/s²]; default: the model's.
        """
        count, n = q.shape
        dq, dv, mass = (np.empty((count, n, n)) for _ in range(3))
        q, v, a = self._rows(q, v, a)
        model, data = self._model, self._data
        derivatives, joint_regressor = pin.computeRNEADerivatives, pin.computeJointTorqueRegressor
        with self._under(gravity):
            for rows, parameters in blocks:
                self._set(parameters)
                states = zip(q[rows], v[rows], a[rows], strict=True)
                for k, state in zip(range(*rows.indices(count)), states, strict=True):
                    dq[k], dv[k], mass[k] = derivatives(model, data, *state)
                    if regressor is not None:
                        regressor[k] = joint_regressor(model, data, *state)
        if self._sorted:
            return LinkTerms(dq, dv, mass)
        if regressor is not None:
            regressor[:] = regressor[:, self._order][:, :, self._columns]
        i, j = np.ix_(self._order, self._order)
        return LinkTerms(dq[:, i, j], dv[:, i, j], mass[:, i, j])

    def torque(self, parameters: Array, q: Array, v: Array, a: Array, gravity: Array | None = None) -> Array:
        """Y Γ for bodies with `parameters` (n, 10), shape (N, n) [Nm]; `gravity` as in `evaluate`."""
        self._set(parameters)
        states = [level.T for level in self._rows(q, v, a)]
        with self._under(gravity):  # one thread, like `evaluate`: the other cores have work of their own
            pool = pin.ModelPool(self._model, 1)
            torque = pin.rneaInParallel(1, pool, *states).T
        return self._robot.from_pin(torque.reshape(q.shape))  # Pinocchio drops an axis of length 1

    def gravity_torque(self, parameters: Array, q: Array, axis: int) -> Array:
        """Y Γ at rest under an acceleration of 1 m/s² along a base axis, shape (N, n) [Nm]."""
        still = np.zeros_like(q)
        return self.torque(parameters, q, still, still, np.eye(3)[axis])

    def regressor(self, q: Array, v: Array, a: Array) -> Array:
        """Y alone, shape (N, n, 10n)."""
        count, n = q.shape
        out = np.empty((count, n, 10 * n))
        q, v, a = self._rows(q, v, a)
        for k in range(count):
            out[k] = pin.computeJointTorqueRegressor(self._model, self._data, q[k], v[k], a[k])
        return out if self._sorted else out[:, self._order][:, :, self._columns]

    @contextmanager
    def _under(self, gravity: Array | None) -> Iterator[None]:
        usual = self._model.gravity.linear.copy()
        try:
            if gravity is not None:
                self._model.gravity.linear = gravity
            yield
        finally:
            self._model.gravity.linear = usual

    def _rows(self, *levels: Array) -> list[Array]:
        return [np.ascontiguousarray(self._robot.to_pin(level)) for level in levels]

    def _set(self, parameters: Array) -> None:
        for i, row in enumerate(parameters):
            inertia = pin.Inertia.FromDynamicParameters(row) if row[0] else pin.Inertia.Zero()
            self._model.inertias[1 + int(self._order[i])] = inertia
