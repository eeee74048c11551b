"""Rigid-body terms of the link side at many samples, by Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.robot._pinocchio import pin, torques
from flexviz.robot.robot import Robot

SIDE_BY_SIDE = 24  # joints of all copies: with more, the zeros between the copies take longer than calls


@dataclass(frozen=True)
class LinkTerms:
    """Derivatives of Y(q, q̇, q̈) Γ at N samples, in the set's joint order."""

    dq: Array  # (N, n, n), ∂(YΓ)/∂q [Nm/rad]
    dv: Array  # (N, n, n), ∂(YΓ)/∂q̇ [Nm s/rad]
    mass: Array  # (N, n, n), M(q) [kg m²]
    torque: Array | None = None  # (N, n), transmission torque of the joints [Nm]; None if it is not known
    # (n,) [rad/s], band in which effects see that torque, after the observer's; None for all frequencies
    seen: Array | None = None

    def rows(self, rows: slice) -> LinkTerms:
        """The same at some of the samples."""
        torque = None if self.torque is None else self.torque[rows]
        return LinkTerms(self.dq[rows], self.dv[rows], self.mass[rows], torque, self.seen)


class LinkDynamics:
    """Evaluates Y(q, q̇, q̈) and the derivatives of Y Γ.

    A call of Pinocchio takes longer than what it computes for a few joints, so that a model of several copies
    of the robot, side by side, evaluates as many samples at once.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._model = robot.model.copy()
        self._copies = max(1, SIDE_BY_SIDE // robot.n)
        self._many = _side_by_side(self._model, self._copies)
        self._data = self._many.createData()
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
        model, data, square, wide = self._many, self._data, self._parts(n), self._parts(10 * n)
        derivatives, joint_regressor = pin.computeRNEADerivatives, pin.computeJointTorqueRegressor
        with _under(model, gravity):
            for rows, parameters in blocks:
                self._set(model, parameters)
                for here, state in self._states(rows, q, v, a):
                    of_q, of_v, of_a = derivatives(model, data, *state)
                    size = here.stop - here.start
                    dq[here], dv[here] = square(of_q)[:size], square(of_v)[:size]
                    mass[here] = square(of_a.T)[:size]
                    if regressor is not None:
                        regressor[here] = wide(joint_regressor(model, data, *state))[:size]
        if self._sorted:
            return LinkTerms(dq, dv, mass)
        if regressor is not None:
            regressor[:] = regressor[:, self._order][:, :, self._columns]
        i, j = np.ix_(self._order, self._order)
        return LinkTerms(dq[:, i, j], dv[:, i, j], mass[:, i, j])

    def torque(self, parameters: Array, q: Array, v: Array, a: Array, gravity: Array | None = None) -> Array:
        """Y Γ for bodies with `parameters` (n, 10), shape (N, n) [Nm]; `gravity` as in `evaluate`."""
        self._set(self._model, parameters)
        states = [level.T for level in self._rows(q, v, a)]
        with _under(self._model, gravity):
            torque = torques(self._model, *states).T
        return self._robot.from_pin(torque.reshape(q.shape))  # Pinocchio drops an axis of length 1

    @property
    def gravity(self) -> Array:
        """The robot's acceleration of gravity in the base's frame, shape (3,) [m/s²]."""
        return np.array(self._robot.gravity)

    def gravity_torque(self, parameters: Array, q: Array, axis: int) -> Array:
        """Y Γ at rest under an acceleration of 1 m/s² along a base axis, shape (N, n) [Nm]."""
        still = np.zeros_like(q)
        return self.torque(parameters, q, still, still, np.eye(3)[axis])

    def regressor(self, q: Array, v: Array, a: Array) -> Array:
        """Y alone, shape (N, n, 10n)."""
        count, n = q.shape
        out = np.empty((count, n, 10 * n))
        q, v, a = self._rows(q, v, a)
        own = self._parts(10 * n)
        for here, state in self._states(slice(0, count), q, v, a):
            found = pin.computeJointTorqueRegressor(self._many, self._data, *state)
            out[here] = own(found)[: here.stop - here.start]
        return out if self._sorted else out[:, self._order][:, :, self._columns]

    def _states(self, rows: slice, *levels: Array) -> Iterator[tuple[slice, Sequence[Array]]]:
        """As many of the samples at a time as there are copies, and their states side by side."""
        start, stop, _ = rows.indices(len(levels[0]))
        whole = stop - (stop - start) % self._copies
        many = [level[start:whole].reshape(-1, self._many.nv) for level in levels]
        for first, state in zip(range(start, whole, self._copies), zip(*many, strict=True), strict=True):
            yield slice(first, first + self._copies), state
        if whole < stop:  # what the other copies do does not matter
            yield slice(whole, stop), [np.resize(level[whole:stop], self._many.nv) for level in levels]

    def _parts(self, width: int) -> Callable[[Array], Array]:
        """Each copy's own part, (S, n, width), of a matrix for all of them, (S n, S width)."""
        shape = self._copies, self._robot.n, self._copies, width
        return lambda found: found.reshape(shape).diagonal(0, 0, 2).transpose(2, 0, 1)

    def _rows(self, *levels: Array) -> list[Array]:
        return [np.ascontiguousarray(self._robot.to_pin(level)) for level in levels]

    def _set(self, model: Any, parameters: Array) -> None:
        """Inertial parameters of the robot, or of each copy."""
        for i, row in enumerate(parameters):
            inertia = pin.Inertia.FromDynamicParameters(row) if row[0] else pin.Inertia.Zero()
            for joint in range(1 + int(self._order[i]), model.njoints, len(parameters)):
                model.inertias[joint] = inertia


@contextmanager
def _under(model: Any, gravity: Array | None) -> Iterator[None]:
    usual = model.gravity.linear.copy()
    try:
        if gravity is not None:
            model.gravity.linear = gravity
        yield
    finally:
        model.gravity.linear = usual


def _side_by_side(model: Any, copies: int) -> Any:
    """A model of copies of a robot on the same base; the joints of a copy follow one another."""
    many = pin.Model()
    many.gravity = model.gravity
    for k in range(copies):
        for joint in range(1, model.njoints):
            parent = int(model.parents[joint])
            at = many.addJoint(
                parent + k * (model.njoints - 1) if parent else 0,
                model.joints[joint],
                model.jointPlacements[joint],
                f"{k}: {model.names[joint]}",
            )
            many.inertias[at] = model.inertias[joint]
    return many
