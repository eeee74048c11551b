"""Torques that the robot does not make itself: brakes and supports that hold it at rest, hands that push it.

Means over about half a second, in which vibrations cancel, are compared with the robot's masses, motor
inertia, viscous and Coulomb friction and an offset, fitted to each joint where it moves. What is left there
is what these do not know. A torque at rest that is further off than that, and than static friction, does not
hold the arm; a torque in motion that is off once, and not when the same motion comes again, comes from
outside.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices
from flexviz.base.errors import InputError
from flexviz.base.spelling import number
from flexviz.data.measurements import GAP
from flexviz.data.noise.findings import Channel, Remedy, SampleFinding, runs
from flexviz.data.noise.thresholds import THRESHOLDS
from flexviz.robot.robot import PayloadBody, Robot

FEWEST = 20  # means in motion that a fit needs


@dataclass(frozen=True, eq=False)
class GroupSamples:
    """One group and its payload."""

    time: Array  # (N,) [s] after the log's first sample
    theta: Array  # (N, n) [rad]
    tau: Array  # (N, n) [Nm]
    bodies: Sequence[PayloadBody] = ()


def check_outside(recording: GroupSamples, robot: Robot) -> list[SampleFinding]:
    """Stretches at rest with a torque that cannot hold the arm, and stretches of contact."""
    means = _Means.of(recording)
    if means is None:
        return []
    try:
        rigid = robot.cad_torques(recording.bodies, means.q, means.v, means.a)
    except InputError:
        return []  # bodies without mass
    if not np.isfinite(rigid).all():
        return []
    fits = [_JointFit.of(means, rigid[:, j], j) for j in range(robot.n)]
    return [*_held(recording, robot, means, fits), *_contacts(recording, robot, means, fits)]


@dataclass(frozen=True, eq=False)
class _Means:
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
    def of(recording: GroupSamples) -> _Means | None:
        """None for a recording that is too short; there are none over gaps."""
        time = recording.time
        step = float(np.median(np.diff(time)))
        width = max(2, round(THRESHOLDS.smoothed / step))
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
        at = np.arange(width // 4, len(q), width // 2)
        at = at[whole[at]]
        if len(at) < FEWEST:
            return None
        edges = np.concatenate([[time[0]], (middle[at][1:] + middle[at][:-1]) / 2, [time[-1] + step]])
        rows = np.searchsorted(time, edges)
        return _Means(middle[at], q[at], v[at], a[at], torque[at], rows)

    def at_rest(self, j: int) -> Bools:
        """(B,) where a joint rests, before and after."""
        slow = np.abs(np.diff(self.q[:, j])) < THRESHOLDS.resting * np.diff(self.time)
        return np.concatenate([slow[:1], slow[1:] & slow[:-1], slow[-1:]])


@dataclass(frozen=True, eq=False)
class _JointFit:
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
    def of(means: _Means, rigid: Array, j: int) -> _JointFit | None:
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
        count = max(1, round(2 * THRESHOLDS.standing / THRESHOLDS.smoothed))
        slow = np.convolve(off[moving], np.ones(count) / count, "valid")
        return _JointFit(
            off, usual, 1.4826 * float(np.median(np.abs(slow))), THRESHOLDS.static * abs(float(x[3])), rest
        )


def _held(
    recording: GroupSamples, robot: Robot, means: _Means, fits: Sequence[_JointFit | None]
) -> Iterator[SampleFinding]:
    """The joint whose torque at rest is the furthest from holding it, of each stretch of time."""
    worst: dict[tuple[int, int], tuple[float, int]] = {}
    for j, fit in enumerate(fits):
        if fit is None:
            continue
        least = fit.static + max(
            THRESHOLDS.off * fit.slow, THRESHOLDS.push * float(np.std(means.torque[:, j]))
        )
        for run in runs(np.flatnonzero(fit.rest)):
            off = float(np.median(np.abs(fit.off[run[0] : run[1] + 1])))
            span = _span(recording, means, run, j)
            long = recording.time[span[1]] - recording.time[span[0]] > THRESHOLDS.standing
            needed = float(
                np.median(np.abs(means.torque[run[0] : run[1] + 1, j] - fit.off[run[0] : run[1] + 1]))
            )
            if (
                long
                and off > max(least, THRESHOLDS.held * needed)
                and off / least > worst.get(span, (0.0, 0))[0]
            ):
                worst[span] = off / least, j
    by_joint: dict[int, list[tuple[int, int]]] = {}
    for span, (_, j) in worst.items():
        by_joint.setdefault(j, []).append(span)
    for j, spans in by_joint.items():
        channel = _channel(recording, robot, j)
        fit = fits[j]
        assert fit is not None
        first = spans[0]
        inside = slice(*np.searchsorted(means.rows, [first[0], first[1] + 1]))
        off = float(np.median(fit.off[inside])) if len(fit.off[inside]) else 0.0
        mean = float(np.median(recording.tau[first[0] : first[1] + 1, j]))
        unit = "N" if robot.prismatic[j] else "Nm"
        found = (
            f"the joint stands still with {number(mean, 3)} {unit}, {number(abs(off), 3)} {unit} from what "
            f"would hold it; static friction is about {number(fit.static, 2)} {unit}"
        )
        texts = (
            found,
            "brakes, an emergency stop, a drive that is off, or a support",
            "motion under the drives alone",
        )
        samples = np.concatenate([np.arange(a, b + 1) for a, b in spans])
        yield channel.finding("held", samples, texts, _leave_out(recording, spans))


def _span(recording: GroupSamples, means: _Means, run: tuple[int, int], j: int) -> tuple[int, int]:
    """First and last sample of a rest: as long as the position stays where it is."""
    first, last = int(means.rows[run[0]]), int(means.rows[run[1] + 1]) - 1
    theta = recording.theta[:, j]
    low, high = theta[first : last + 1].min(), theta[first : last + 1].max()
    beyond = 0.1 * (high - low) + 1e-12
    stays = (theta >= low - beyond) & (theta <= high + beyond)
    left = np.flatnonzero(~stays)
    k = int(np.searchsorted(left, first))
    return int(left[k - 1]) + 1 if k else 0, int(left[k]) - 1 if k < len(left) else len(theta) - 1


def _contacts(
    recording: GroupSamples, robot: Robot, means: _Means, fits: Sequence[_JointFit | None]
) -> Iterator[SampleFinding]:
    """Stretches in motion that are far from what the same motion takes at other times."""
    for j, fit in enumerate(fits):
        if fit is None:
            continue
        least = max(THRESHOLDS.far_off * fit.usual, THRESHOLDS.push * float(np.std(means.torque[:, j])))
        far = (np.abs(fit.off) > least) & ~fit.rest
        state = np.stack([x[:, j] / max(float(np.std(x[:, j])), 1e-12) for x in (means.q, means.v)], axis=1)
        spans = []
        for a, b in runs(np.flatnonzero(_closed(far))):
            inside = a > 0 and b + 1 < len(far)  # it begins and ends: no start from rest
            long = inside and means.time[b] - means.time[a] > THRESHOLDS.standing
            if (
                long
                and _one_sided(means.time, fit.off, a, b, least)
                and _not_repeated(state, fit.off, a, b, least)
            ):
                spans.append((int(means.rows[a]), max(int(means.rows[b + 1]) - 1, int(means.rows[a]))))
        share = sum(b - a for a, b in spans) / len(recording.time)
        if not spans or share > THRESHOLDS.contact_share:
            continue
        samples = np.concatenate([np.arange(a, b + 1) for a, b in spans])
        largest = float(np.max(np.abs(fit.off[far])))
        seconds = len(samples) * float(np.median(np.diff(recording.time)))
        unit = "N" if robot.prismatic[j] else "Nm"
        found = (
            f"for {number(seconds, 2)} s the torque is up to "
            f"{number(largest, 3)} {unit} away from that of the same motion at other times (usually "
            f"{number(fit.usual, 2)} {unit})"
        )
        texts = found, "a hand, a cable or another contact", "motion without contact"
        yield _channel(recording, robot, j).finding("contact", samples, texts, _leave_out(recording, spans))


def _closed(far: Bools) -> Bools:
    """With single gaps filled."""
    filled = far.copy()
    filled[1:-1] |= far[:-2] & far[2:]
    return filled


def _one_sided(time: Array, off: Array, a: int, b: int, least: float) -> bool:
    """Whether a torque pushes in one direction: a vibration alternates."""
    first, last = np.searchsorted(
        time, [time[a] - 2 * THRESHOLDS.standing, time[b] + 2 * THRESHOLDS.standing]
    )
    sign = np.sign(np.sum(off[a : b + 1]))
    return bool(np.min(sign * off[first:last]) > -0.5 * least)


def _not_repeated(state: Array, off: Array, a: int, b: int, least: float) -> bool:
    """Whether position and velocity of the joint in the means a … b take usual torques at other times."""
    others = np.ones(len(off), dtype=bool)
    others[max(0, a - 3) : b + 4] = False
    near = usual = 0
    for i in range(a, b + 1):
        distance = np.max(np.abs(state[others] - state[i]), axis=1)
        close = np.flatnonzero(distance < THRESHOLDS.same_motion)
        near += len(close) > 0
        usual += len(close) > 0 and bool(np.median(np.abs(off[others][close])) < 0.5 * least)
    return near >= 1 and usual > 0.5 * near


def _channel(recording: GroupSamples, robot: Robot, j: int) -> Channel:
    return Channel("tau", robot.joints[j], recording.time, recording.tau[:, j])


def _leave_out(recording: GroupSamples, spans: Sequence[tuple[int, int]]) -> Remedy:
    """The key that leaves these samples out: `from`, where the recording begins with them, or `to`."""
    time = recording.time
    if len(spans) == 1:
        first, last = spans[0]
        if time[first] - time[0] < THRESHOLDS.smoothed:
            return Remedy("from", round(float(time[min(last + 1, len(time) - 1)]), 3), "log")
        if time[-1] - time[last] < THRESHOLDS.smoothed:
            return Remedy("to", round(float(time[first]), 3), "log")
    stretches = sorted((round(float(time[a]), 3), round(float(time[b]), 3)) for a, b in spans)
    return Remedy("leave_out", tuple(stretches), "log")
