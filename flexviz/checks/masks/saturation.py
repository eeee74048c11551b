"""Limits seen in recorded torques: a drive or a sensor that saturates leaves plateaus at its limit.

On a plateau the recorded torque does not change although the joint moves, and on either side of it the torque
falls away faster than from the top of a smooth curve: a parabola that stays within one step of the record's
resolution for T is three steps lower T/2 further on. There the torque itself is only known to be beyond the
limit, unless the drive could not give more; such rows are left out of fits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.checks.issues import Issue
from flexviz.checks.samples import AllSamples, mask, runs
from flexviz.data.measurements import MeasurementSet, Segment

FEWEST_IN_A_ROW = 4  # equal samples of a plateau
FEWEST = 8  # of all plateaus together
LONGER = 3.0  # times as long as other values last (a log faster than its drive)
COUNT_QUANTILE = 0.01  # of the changes from sample to sample: the resolution, or less than the noise
FALLS = 10.0  # steps of the resolution by which the torque falls on a side of a plateau; 3 of a smooth top
MOVES = 0.02  # of the joint's top speed, at which it moves on average, or else the torque may rest as well
LARGE = 0.5  # of the largest torque: smaller plateaus are no limits
OVERSHOOT = 6  # samples beside a plateau that resampling may lift above it
ROUNDING = 1e-7  # of the largest torque, as of a single-precision number
WIDE = 4.0  # standard deviations of a noise that is added to a limited torque


@dataclass(frozen=True)
class SeenLimit:
    """The limit at which the recorded torque of a joint stands.

    Attributes:
        joint: index.
        lower, upper: where the plateaus are [Nm]; −∞, ∞ where a side has none.
        rows: recorded samples on the plateaus, of all groups.
        tolerance: within which a torque is at a limit [Nm].
    """

    joint: int
    lower: float
    upper: float
    rows: int
    tolerance: float

    @property
    def limit(self) -> float:
        """Its size [Nm]; the mean of both sides where both have plateaus."""
        return float(np.mean([abs(side) for side in (self.lower, self.upper) if np.isfinite(side)]))

    def reached(self, tau: Array) -> Bools:
        """Samples of τ (N,) at the limit, (N,)."""
        return (tau >= self.upper - self.tolerance) | (tau <= self.lower + self.tolerance)


_FOUND: WeakKeyDictionary[MeasurementSet, tuple[SeenLimit, ...]] = WeakKeyDictionary()


def seen_limits(measurements: MeasurementSet) -> tuple[SeenLimit, ...]:
    """Limits at which the recorded torques of a set stand, found once."""
    if measurements not in _FOUND:
        segments = [segment for group in measurements.groups for segment in group.segments]
        _FOUND[measurements] = saturated_joints(segments)
    return _FOUND[measurements]


def saturated_joints(segments: Sequence[Segment]) -> tuple[SeenLimit, ...]:
    """The limits of the joints whose torque saturates."""
    if not segments:
        return ()
    found = (_seen(segments, j) for j in range(segments[0].tau.shape[1]))
    return tuple(one for one in found if one is not None)


@mask
def saturated(samples: AllSamples) -> Iterator[Issue]:
    """Torques that stand at a limit while their joints move: one issue per joint."""
    for one in saturated_joints(samples.segments):
        values = {name: getattr(one, name) for name in ("lower", "upper", "tolerance", "rows")}
        yield Issue("saturated", "odd", (samples.robot.joints[one.joint],), "tau", values)


@dataclass(frozen=True, eq=False)
class _Joint:
    """One joint's record.

    Attributes:
        tau, theta: (N,) of each segment [Nm], [rad].
        largest: of |τ| [Nm].
        top_speed: [rad] per sample.
        least: samples in a row that are a plateau.
    """

    tau: list[Array]
    theta: list[Array]
    largest: float
    top_speed: float
    least: float


@dataclass(frozen=True)
class _Level:
    """Where plateaus may be [Nm], within which tolerance, and how much of a smooth curve would seem flat."""

    value: float
    tolerance: float
    width: float


def _seen(segments: Sequence[Segment], j: int) -> SeenLimit | None:
    tau = [s.tau[:, j] for s in segments]
    largest = max(float(np.max(np.abs(y))) for y in tau)
    changes = np.concatenate([np.abs(np.diff(y)) for y in tau])
    counted = changes[changes > ROUNDING * largest]
    if not len(counted):
        return None
    resolution = float(np.quantile(counted, COUNT_QUANTILE))
    speeds = np.concatenate([np.abs(s.mean_speeds[:, j]) * s.step for s in segments])
    lasts = float(np.quantile(np.concatenate([_lasting(y, ROUNDING * largest) for y in tau]), 0.9))
    least = max(FEWEST_IN_A_ROW, LONGER * lasts)
    theta = [s.theta[:, j] for s in segments]
    joint = _Joint(tau, theta, largest, float(np.quantile(speeds, 0.95)), least)
    for levels in (_exact(resolution), _noisy(joint)):
        sides = [_side(joint, sign, levels) for sign in (-1.0, 1.0)]
        if found := [side for side in sides if side is not None]:
            low, high = (np.inf if side is None else side.value for side in sides)
            one = SeenLimit(j, -low, high, 0, max(side.tolerance for side in found))
            return replace(one, rows=sum(int(np.count_nonzero(one.reached(y))) for y in tau))
    return None


def _lasting(y: Array, tolerance: float) -> Array:
    """How many samples each value of y (N,) that changes later lasts, for all but its extreme values."""
    edges = np.flatnonzero(np.abs(np.diff(y)) > tolerance)
    lengths, values = np.diff(edges), y[edges[:-1] + 1]
    inner = np.abs(values) < (1 - LARGE * LARGE) * np.max(np.abs(y))
    return lengths[inner] if inner.any() else np.ones(1)


def _exact(resolution: float) -> Callable[[_Joint, Array], _Level | None]:
    """The value that most samples share of those that are equal to the one before."""

    def found(joint: _Joint, up: Array) -> _Level | None:
        tolerance = ROUNDING * joint.largest
        same = up[1:][(np.abs(np.diff(up)) <= tolerance) & (up[1:] >= LARGE * joint.largest)]
        if not len(same):
            return None
        rounded, counts = np.unique(np.round(same / tolerance), return_counts=True)
        shared = same[np.abs(same / tolerance - rounded[np.argmax(counts)]) < 1.0]
        return _Level(float(np.median(shared)), 2 * tolerance, resolution)

    return found


def _noisy(joint: _Joint) -> Callable[[_Joint, Array], _Level | None]:
    """The middle of the samples that are as near the largest one as noise is wide."""
    differences = np.concatenate([np.abs(np.diff(y, 4)) for y in joint.tau])
    noise = float(np.median(differences)) / 0.6745 / np.sqrt(70.0)  # variance of fourth differences: 70 σ²

    def found(joint: _Joint, up: Array) -> _Level | None:
        top = float(np.max(up))
        if noise == 0.0 or top < LARGE * joint.largest:
            return None
        level = float(np.median(up[up >= top - 2 * WIDE * noise]))
        return _Level(level, WIDE * noise, 2 * WIDE * noise)

    return found


def _side(joint: _Joint, sign: float, levels: Callable[[_Joint, Array], _Level | None]) -> _Level | None:
    """Where sign·τ has its plateaus, if it has."""
    level = levels(joint, np.concatenate([sign * y for y in joint.tau]))
    if level is None:
        return None
    rows = plateaus = beyond = 0
    for y, theta in zip(joint.tau, joint.theta, strict=True):
        up = sign * y - level.value
        beyond += int(np.count_nonzero(up > level.tolerance))
        for first, last in runs(np.flatnonzero(np.abs(up) <= level.tolerance)):
            end = last + 1
            count = end - first
            moves = np.ptp(theta[first:end]) >= MOVES * joint.top_speed * count
            if count >= joint.least and moves and _falls(up, first, end, FALLS * level.width):
                rows, plateaus = rows + count, plateaus + 1
    return level if rows >= FEWEST and beyond <= 2 * OVERSHOOT * plateaus and beyond < rows else None


def _falls(up: Array, first: int, end: int, least: float) -> bool:
    """Whether the torque falls by this much on the sides of a plateau, or on the one that was recorded."""
    beside = max((end - first) // 2, 1)
    sides = [up[i] for i in (first - beside, end - 1 + beside) if 0 <= i < len(up)]
    return bool(sides) and max(sides) < -least
