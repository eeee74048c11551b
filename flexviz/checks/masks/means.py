"""Torques that the robot does not make itself: what its masses, motor inertia and friction leave of them.

Means over about half a second, in which vibrations cancel, are compared with the robot's masses, motor
inertia, viscous and Coulomb friction and an offset, fitted to each joint where it moves. What is left there
is what these do not know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices
from flexviz.base.errors import InputError
from flexviz.base.facts import Remedy
from flexviz.checks.samples import GroupSamples
from flexviz.data.measurements import GAP
from flexviz.data.noise import Channel
from flexviz.robot.robot import Robot

FEWEST = 20  # means in motion that a fit needs
SMOOTHED = 0.25  # [s] three means over it, one of the other, leave 6 % of a vibration of 2.5 Hz
RESTING = 5e-3  # [rad/s], [m/s] a slower joint rests
STANDING = 0.4  # [s] shorter rests and contacts tell nothing
STATIC = 2.0  # times its Coulomb friction that a joint may have at rest
PUSH = 0.3  # of the torque's spread: a smaller one is not said to come from outside


@dataclass(frozen=True, eq=False)
class TorquesLeft:
    """Means of one group, and the fit of each joint; None where nothing is known about it."""

    means: TorqueMeans
    fits: tuple[MeansFit | None, ...]


_FOUND: WeakKeyDictionary[GroupSamples, TorquesLeft | None] = WeakKeyDictionary()


def torques_left(recording: GroupSamples, robot: Robot) -> TorquesLeft | None:
    """What masses and friction leave, found once; None for a group that is too short, or without masses."""
    if recording not in _FOUND:
        _FOUND[recording] = _torques_left(recording, robot)
    return _FOUND[recording]


def _torques_left(recording: GroupSamples, robot: Robot) -> TorquesLeft | None:
    means = TorqueMeans.of(recording)
    if means is None:
        return None
    try:
        rigid = robot.cad_torques(recording.bodies, means.q, means.v, means.a)
    except InputError:
        return None  # bodies without mass
    if not np.isfinite(rigid).all():
        return None
    return TorquesLeft(means, tuple(MeansFit.of(means, rigid[:, j], j) for j in range(robot.n)))


@dataclass(frozen=True, eq=False)
class TorqueMeans:
    """Weighted means of position and torque, the same of both, and derivatives of the former.

    (B,) the middle [s], and (B, n) position, velocity, acceleration and torque, at every half `period`.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    torque: Array
    rows: Indices  # (B + 1,) samples of the recording where they begin and end

    @staticmethod
    def of(
        recording: GroupSamples, smoothed: float = SMOOTHED, every: float = SMOOTHED / 2
    ) -> TorqueMeans | None:
        """None for a recording that is too short; there are none over gaps.

        Args:
            recording: of one group.
            smoothed: of each of three means, one of the other [s].
            every: from one mean to the next [s].
        """
        time = recording.time
        step = float(np.median(np.diff(time)))
        width = max(2, round(smoothed / step))
        uniform = np.arange(time[0], time[-1], step)
        if len(uniform) < FEWEST * width:
            return None
        box = np.ones(width) / width
        weights = np.convolve(np.convolve(box, box), box)  # no vibration passes

        def mean(x: Array) -> Array:
            columns = [np.convolve(np.interp(uniform, time, y), weights, "valid") for y in x.T]
            return np.real(np.stack(columns, axis=1))

        q, torque = mean(recording.theta), mean(recording.tau)
        v = np.gradient(q, step, axis=0)
        a = np.gradient(v, step, axis=0)
        middle = uniform[len(weights) // 2 :][: len(q)]
        apart = np.diff(time)[np.clip(np.searchsorted(time, uniform) - 1, 0, len(time) - 2)]
        whole = np.convolve(apart > GAP * step, np.ones(len(weights)), "valid") < 0.5
        at = np.arange(width // 4, len(q), max(1, round(every / step)))
        at = at[whole[at]]
        if len(at) < FEWEST:
            return None
        edges = np.concatenate([[time[0]], (middle[at][1:] + middle[at][:-1]) / 2, [time[-1] + step]])
        rows = np.searchsorted(time, edges)
        return TorqueMeans(middle[at], q[at], v[at], a[at], torque[at], rows)

    def at_rest(self, j: int) -> Bools:
        """(B,) where a joint rests, before and after."""
        slow = np.abs(np.diff(self.q[:, j])) < RESTING * np.diff(self.time)
        return np.concatenate([slow[:1], slow[1:] & slow[:-1], slow[-1:]])


@dataclass(frozen=True, eq=False)
class MeansFit:
    """The torque of one joint where it moves.

    Attributes:
        off: (B,) what the masses, inertia and friction leave of it [Nm]; at rest without friction.
        usual: typical size of that in motion [Nm].
        slow: typical size of its means over `standing` in motion [Nm].
        static: torque that friction may take at rest [Nm].
        rest: (B,) where the joint rests.
    """

    off: Array
    usual: float
    slow: float
    static: float
    rest: Bools

    @staticmethod
    def of(means: TorqueMeans, rigid: Array, j: int) -> MeansFit | None:
        rest, torque, v = means.at_rest(j), means.torque[:, j], means.v[:, j]
        moving = ~rest
        if np.count_nonzero(moving) < FEWEST:
            return None
        sign = np.tanh(v / (0.05 * np.max(np.abs(v))))
        columns = np.stack([rigid, means.a[:, j], v, sign, np.ones_like(v)], axis=1)
        x, weight = np.zeros(5), moving.astype(float)
        for _ in range(10):  # Huber: a contact does not count as much as it is large
            scale = np.sqrt(weight)
            x = np.linalg.lstsq(columns * scale[:, None], torque * scale, rcond=None)[0]
            left = np.abs(torque - columns @ x)
            usual = 1.4826 * float(np.median(left[moving]))
            weight = moving * np.minimum(1.0, 1.5 * usual / np.maximum(left, 1e-300))
        if x[0] <= 0.0:
            return None  # the torque does not follow the masses: nothing is known about it
        off = torque - columns @ x + np.where(rest, columns[:, 2:4] @ x[2:4], 0.0)
        count = max(1, round(2 * STANDING / SMOOTHED))
        slow = np.convolve(off[moving], np.ones(count) / count, "valid")
        return MeansFit(off, usual, 1.4826 * float(np.median(np.abs(slow))), STATIC * abs(float(x[3])), rest)


def torque_channel(recording: GroupSamples, robot: Robot, j: int) -> Channel:
    """τ of a joint at the group's instants, with the rows of its log."""
    name = robot.joints[j]
    logged = next(channel for channel in recording.channels if channel.joint == name)
    at = np.clip(np.searchsorted(logged.time, recording.time - 1e-9), 0, len(logged.time) - 1)
    rows = at if logged.rows is None else logged.rows[at]
    return Channel("tau", name, recording.time, recording.tau[:, j], rows=rows)


def leaving_out(recording: GroupSamples, spans: Sequence[tuple[int, int]]) -> Remedy:
    """The key that leaves these samples out: `from`, where the recording begins with them, or `to`."""
    time = recording.time
    if len(spans) == 1:
        first, last = spans[0]
        if time[first] - time[0] < SMOOTHED:
            return Remedy("from", round(float(time[min(last + 1, len(time) - 1)]), 3), "log")
        if time[-1] - time[last] < SMOOTHED:
            return Remedy("to", round(float(time[first]), 3), "log")
    stretches = sorted((round(float(time[a]), 3), round(float(time[b]), 3)) for a, b in spans)
    return Remedy("leave_out", tuple(stretches), "log")
