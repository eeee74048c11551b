"""How well the robot's masses explain the torques that were read: one score for every reading of the columns.

Each joint's torque is compared with

    τ = s_G G(q) + s_I (M(q) q̈ + C(q, q̇) q̇) + s_P P(q, q̇, q̈) + B q̈ + d q̇ + c sgn(q̇) + offset + e

of the CAD model, P being the torque of the payload. Masses are known roughly, those of payloads better, so
ln s are normal about 0, and B is of the order of the joint's inertia; friction dissipates, so d and c are not
negative. A reading's score is the logarithm of how probable the torques are with it. What the model leaves is
an error that is independent from swing to swing and whose size is unknown, one at low frequencies and another
at those at which joints yield: so a soft arm's gravity is not lost in its vibration. Readings of the same
columns can be compared by their scores, whatever they change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.checks.joint_fit import (
    UNKNOWN_SIZE,
    Band,
    JointFit,
    TorqueColumns,
    fit_joint,
    reduced,
    swings_of,
)
from flexviz.checks.limits import likely_limits
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS, SURE
from flexviz.data.logs import followed, joint_parts
from flexviz.data.measurements import GroupTable, sample_motion
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import PayloadBody, Robot

LoadedTable = tuple[Sequence[PayloadBody], GroupTable]  # a group and the payload that it carried
LARGEST_SAMPLE = 400  # instants of all groups together
FEWER = 4  # of which one is enough to rule a reading out
CERTAIN = 3.0  # standard errors


class Comparison:
    """The motion of all groups at a few instants, and the scores of its readings.

    `watch` is called before each reading; it may raise to stop.
    """

    def __init__(
        self, robot: Robot, groups: Sequence[LoadedTable], watch: Callable[[], None] = lambda: None
    ) -> None:
        self.robot, n = robot, robot.n
        self._watch = watch
        self.groups = groups
        self._alone: dict[int, Comparison] = {}
        self.bodies = tuple(tuple(bodies) for bodies, _ in groups)
        self.stated = Reading.stated(robot, self.bodies)
        self.names = [table.name for _, table in groups]
        motions = [sample_motion(table.time, table.theta, table.tau) for _, table in groups]
        every = max(1, -(-sum(len(m.q) for m in motions) // LARGEST_SAMPLE))
        self.q, self.v, self.a, self.torque, self.rate = (
            [getattr(m, name)[::every] for m in motions] for name in ("q", "v", "a", "torque", "rate")
        )
        # (groups, n) of θ as read
        self.span = np.array([np.ptp(table.theta, axis=0) for _, table in groups])
        self.speed = np.array([np.max(np.abs(m.v), axis=0) for m in motions])
        every_torque = np.concatenate([table.tau for _, table in groups])
        # (n,) whether τ as read, up to a common sign of the column, is never on the other side of zero
        self.one_sided = np.any(every_torque != 0.0, axis=0) & (
            np.all(every_torque >= 0.0, axis=0) | np.all(every_torque <= 0.0, axis=0)
        )
        self.width, self.fastest = likely_limits(robot)
        # (n,) θ per q where q is recorded, shows the same motion and is one that the joint can make; else 0
        self.by_q = np.zeros(n)
        for j in range(n):
            parts = joint_parts([table for _, table in groups], j, "q")
            share, slope = followed(parts)
            possible = max((part.span for part in parts), default=0.0) < LIMITS.beyond * self.width[j]
            if slope and share >= LIMITS.same_motion and possible:
                self.by_q[j] = 1.0 / slope
        model, data = robot.model, robot.model.createData()
        poses = np.random.default_rng(0).uniform(-np.pi, np.pi, size=(32, n))
        largest = robot.from_pin(np.max([np.diag(pin.crba(model, data, q)) for q in poses], axis=0))
        self.inertia = np.maximum(largest, LIMITS.small_link * np.max(largest))
        self.lasts = [float(table.time[-1] - table.time[0]) for _, table in groups]  # [s]
        self._models: dict[tuple[PayloadBody, ...] | None, Any] = {}
        self._rigid: dict[tuple[object, ...], Array] = {}
        self._r: dict[int, list[Band]] = {}
        self._fits: dict[tuple[int, int, int, bool], JointFit] = {}
        self.seconds = sum(self.lasts)
        slow = [self.slow @ (self.slow.T @ column) for column in np.concatenate(self.torque).T]
        self.swings = [
            np.array([swings_of(low), swings_of(column - low)])
            for low, column in zip(slow, np.concatenate(self.torque).T, strict=True)
        ]

    @cached_property
    def kilogram(self) -> PayloadBody:
        """A small body of 1 kg at the last link: where a stated payload is, else at the link's origin."""
        stated = [body for bodies in self.bodies for body in bodies]
        link, com = (stated[-1].link, stated[-1].com) if stated else (self.robot.links[-1], np.zeros(3))
        return PayloadBody(link, 1.0, com, np.zeros(6))

    @cached_property
    def usable(self) -> bool:
        """Whether the robot has masses and the motion is long enough to prove anything."""
        try:
            torque = sum(self._parts(self.stated))
        except InputError:
            return False
        return bool(self.seconds >= LIMITS.shortest_motion and np.isfinite(torque).all() and np.any(torque))

    def fits(self, reading: Reading) -> list[JointFit]:
        """The fit of every joint."""
        return [self._fit(j, bands, reading) for j, bands in enumerate(self._reduced(reading))]

    def _fit(self, j: int, bands: list[Band], reading: Reading) -> JointFit:
        column, free = reading.tau_order[j], bool(reading.free[j])
        key = j, id(bands), column, free  # `_r` keeps the bands
        if key not in self._fits:
            self._fits[key] = fit_joint(bands, self.swings[column], self.inertia[j], free)
        return self._fits[key]

    @cached_property
    def slow(self) -> Array:
        """(M, k) orthonormal cosines of the frequencies at which a joint is rigid, group by group."""
        lengths = [len(q) for q in self.q]
        counts = [
            min(1 + int(2 * LIMITS.rigid_below * seconds), rows)
            for rows, seconds in zip(lengths, self.lasts, strict=True)
        ]
        basis = np.zeros((sum(lengths), sum(counts)))
        row = column = 0
        for rows, waves in zip(lengths, counts, strict=True):
            block = np.cos(np.pi * np.arange(waves) * (np.arange(rows)[:, None] + 0.5) / rows)
            basis[row : row + rows, column : column + waves] = block / np.linalg.norm(block, axis=0)
            row, column = row + rows, column + waves
        return basis

    def _reduced(self, reading: Reading) -> list[list[Band]]:
        """Of each joint: what its torque is explained by, in two bands; nothing where it rests."""
        self._watch()
        every = self.columns(reading)
        for columns in every:
            if columns.key not in self._r:
                self._r[columns.key] = reduced(columns, self.slow)
        return [self._r[columns.key] for columns in every]

    def columns(self, reading: Reading) -> list[TorqueColumns]:
        """Of each joint: what may explain its torque."""
        parts, (_, v, a) = self._parts(reading), self._motion(reading)
        tau = self._tau(reading)
        acting = np.eye(self.robot.n)  # of motors (rows) on joints
        if reading.drive is not None:
            back = np.linalg.inv(reading.drive).T
            v, a = v @ back, a @ back
            if reading.converted:
                acting = back.T
            else:
                parts = parts @ reading.drive
        v, a = v * reading.motion, a * reading.motion
        if reading.magnitude:
            tau = np.abs(tau) * np.where(np.sum(parts, axis=0) < 0.0, -1.0, 1.0)
        result, none = [], np.zeros((len(tau), 0))
        for j, motors in enumerate(acting.T):
            speeds = v[:, motors != 0.0] * motors[motors != 0.0]
            drift = self.ramps if reading.drifts[j] else none
            result.append(TorqueColumns(parts[:, :, j].T, a[:, j], speeds, tau[:, j], drift))
        return result

    @cached_property
    def ramps(self) -> Array:
        """(M, groups) a torque that drifts over each group [1]."""
        lengths = [len(q) for q in self.q]
        group = np.repeat(np.eye(len(lengths)), lengths, axis=0)
        time = np.concatenate([np.linspace(-0.5, 0.5, length) for length in lengths])
        return np.real(group * time[:, None])

    def bound(self, reading: Reading, few: bool = True, quick: bool = False) -> float:
        """What a score cannot exceed; from a few of the instants up to a common constant, and hardly.

        `quick`: a larger bound that takes less time.
        """
        total = np.sum(reading.free) * UNKNOWN_SIZE + self.penalty(reading)
        for bands, column in zip(
            (self.few if few else self)._reduced(reading), reading.tau_order, strict=True
        ):
            for band, swings in zip(bands, self.swings[column], strict=False):
                left = band.least_left_of_any if quick else band.least_left
                total -= 0.5 * swings * np.log(left + LIMITS.model_error)
        return float(total)

    @cached_property
    def doubts_size(self) -> bool:
        """Whether any torque is surely more probable with another size, whatever its sign."""
        stated, needed = self.stated, SURE - np.log(LIMITS.fault)
        before = np.array([fit.score for fit in self.fits(stated)])
        free = replace(stated, free=np.ones(self.robot.n, bool))
        signs = (stated.sign, -stated.sign)
        after = [[fit.score for fit in self.fits(replace(free, sign=sign))] for sign in signs]
        return bool(np.any(np.array(after) - before > needed))

    def alone(self, group: int) -> Comparison:
        """One of the groups, made once."""
        if group not in self._alone:
            self._alone[group] = Comparison(self.robot, self.groups[group : group + 1], self._watch)
        return self._alone[group]

    @cached_property
    def few(self) -> Comparison:
        """The same at a few of the instants."""
        few = copy(self)
        few._rigid, few._r, few._fits = {}, {}, {}
        for made in ("slow", "ramps", "doubts_size"):
            few.__dict__.pop(made, None)
        for name in ("q", "v", "a", "torque", "rate"):
            setattr(few, name, [x[::FEWER] for x in getattr(self, name)])
        return few

    def beyond(self, reading: Reading) -> Array:
        """(n,) whether θ leaves what the joint can do, or is not as far as q."""
        order, factor = list(reading.theta_order), np.abs(reading.factor)
        span, speed = self.span[:, order] * factor, self.speed[:, order] * factor
        impossible = (span > LIMITS.beyond * self.width) | (speed > LIMITS.beyond * self.fastest)
        ratio = np.abs(self.by_q[order]) * factor
        other = (ratio > 0.0) & (np.abs(np.log(np.maximum(ratio, 1e-12))) > np.log(LIMITS.agrees))
        return np.any(impossible | other, axis=0)

    def score(self, reading: Reading) -> float:
        """The sum of the joints' scores; less where θ leaves their range."""
        return sum(fit.score for fit in self.fits(reading)) + self.penalty(reading)

    def penalty(self, reading: Reading) -> float:
        """What joints that leave their range cost."""
        return float(np.sum(self.beyond(reading))) * float(np.log(LIMITS.out_of_range))

    def room(self, reading: Reading) -> Array:
        """(n,) by how much each joint's score can rise at most."""
        rooms = np.array([fit.room for fit in self.fits(reading)])
        return rooms - self.beyond(reading) * float(np.log(LIMITS.out_of_range))

    def unphysical(self, reading: Reading, j: int) -> bool:
        """Whether friction or inertia of a joint is surely negative, whatever the masses are."""
        parts, v = self._parts(reading), self._motion(reading)[1]
        tau = self._tau(reading)[:, j]
        gravity, motion, payload = parts[:, :, j]
        matrix = np.column_stack([v[:, j], motion, gravity, payload, np.ones(len(tau))])
        inverse = np.linalg.pinv(matrix, rcond=1e-9)
        left = tau - matrix @ (inverse @ tau)
        std = np.sqrt(left @ left / swings_of(left) * np.sum(inverse**2, axis=1))
        return bool(np.any((inverse @ tau)[:2] < -CERTAIN * std[:2]))

    def best_score(self) -> float:
        """How well the torques are explained by any size and sign, summed over the joints."""
        start = self.stated
        free = replace(start, free=np.ones(self.robot.n, bool))
        fits = [self.fits(replace(free, sign=sign * start.sign)) for sign in (1.0, -1.0)]
        return (
            sum(max(plus.share, minus.share) for plus, minus in zip(*fits, strict=True))
            if self.usable
            else 0.0
        )

    def _tau(self, reading: Reading) -> Array:
        """τ (M, n) as it is read."""
        order = list(reading.tau_order)
        torque, rate = (np.concatenate(x)[:, order] for x in (self.torque, self.rate))
        return (torque + reading.late * rate) * reading.sign * self._rows(reading.size)

    def angles(self, reading: Reading) -> Array:
        """(M, n) θ as it is read, before its zero."""
        return self._motion(reading)[0] - self._rows(reading.zero)

    def rows_of(self, group: int) -> Bools:
        """(M,) which instants are of a group."""
        return np.repeat(np.arange(len(self.q)) == group, [len(x) for x in self.q])

    def _rows(self, of_groups: Array) -> Array:
        """(M, n) what every instant has of its group, (groups, n)."""
        return np.repeat(of_groups, [len(x) for x in self.q], axis=0)

    def _motion(self, reading: Reading) -> tuple[Array, Array, Array]:
        """q, q̇, q̈ (M, n) as they are read."""
        order, factor = list(reading.theta_order), self._rows(reading.factor)
        q, v, a = (np.concatenate(x)[:, order] * factor for x in (self.q, self.v, self.a))
        if reading.drive is not None and reading.theta_too:
            q, v, a = (x @ reading.drive.T for x in (q, v, a))
        return q + self._rows(reading.zero), v, a

    def _parts(self, reading: Reading) -> Array:
        """(3, M, n) torque of the CAD model's gravity, of its motion, and of the payload."""
        motion = self._motion(reading)
        carried = reading.bodies
        place = motion[0].tobytes(), motion[1].tobytes()
        weights: list[tuple[int | None, float]] = [
            (int(axis), reading.down[axis]) for axis in np.flatnonzero(reading.down)
        ]
        result = np.zeros((3, *motion[0].shape))
        edges = np.append(0, np.cumsum([len(x) for x in self.q]))
        groups = list(map(slice, edges, edges[1:]))
        for axis, weight in [*weights, (None, 1.0)]:
            if reading.motion if axis is None else reading.gravity:
                rigid = self._cached(place, axis, None, motion, slice(0, None))
                result[1 if axis is None else 0] += weight * rigid
            if reading.motion if axis is None else reading.load:
                for bodies, mass, rows in zip(carried, reading.added, groups, strict=True):
                    if bodies:
                        result[2, rows] += weight * self._cached(place, axis, bodies, motion, rows)
                    if mass:
                        one = self._cached(place, axis, (self.kilogram,), motion, rows)
                        result[2, rows] += weight * mass * one
        return result

    def _cached(
        self, place: tuple[bytes, bytes], axis: int | None, bodies: tuple[PayloadBody, ...] | None,
        motion: tuple[Array, Array, Array], rows: slice,
    ) -> Array:  # fmt: skip
        """`_dynamics`, computed once."""
        key = (*place, axis, rows.start, bodies)
        if key not in self._rigid:
            self._rigid[key] = self._dynamics(bodies, tuple(x[rows] for x in motion), axis)
        return self._rigid[key]

    def _dynamics(
        self, bodies: tuple[PayloadBody, ...] | None, motion: tuple[Array, ...], axis: int | None
    ) -> Array:
        """(M, n) CAD torque of unit gravity along an axis or of the motion; of a payload alone if given."""
        model = self._model(bodies)
        model.gravity.linear = np.zeros(3) if axis is None else np.eye(3)[axis]
        data = model.createData()
        q, v, a = map(self.robot.to_pin, motion)
        if axis is None:
            torques = [pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)]
        else:
            torques = [pin.computeGeneralizedGravity(model, data, pose) for pose in q]
        return self.robot.from_pin(np.array(torques))

    def _model(self, bodies: tuple[PayloadBody, ...] | None) -> Any:
        """The CAD model; of a payload alone if given."""
        if bodies not in self._models:
            links = self.robot.cad_parameters * (bodies is None)
            self._models[bodies] = self.robot.model_with(links, bodies or ())
        return self._models[bodies]
