"""From recorded instants to uniformly sampled segments: time checks, gaps, jitter.

A *gap* is an interval longer than 2.75 times the median one. It ends a segment, unless it is short against
the content of the signals and is bridged (`flexviz.data.measurements.bridging`). Within a segment the
instants are compared with the best uniform clock t₀ + i·h:

- within 0.1 % of h, or within the rounding of the recorded numbers (floating point, or a fixed number of
  decimals): the clock was uniform, the values stay and only `time` is made exact;
- beyond: the clock jittered or single samples are missing, and the signals are resampled to the uniform
  clock by polynomials through the six nearest samples, which fills the missing ones. The error is below
  1e-6 of the amplitude for motion slower than 1/30 of the sampling rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from flexviz.base.arrays import Indices
from flexviz.base.errors import InputError
from flexviz.data.measurements.bridging import GAP, Bridged, bridge, lagrange_weights
from flexviz.data.measurements.data import Array, Segment
from flexviz.data.measurements.tables import row_name

JITTER = 1e-3  # deviations from a uniform clock up to this part of a step are no jitter
ROUNDED = 0.05  # steps by which the instants of a clock with missing samples may be rounded
MISSING = 1.75  # steps: longer intervals within a segment lack a sample
SHORTEST = 32  # samples: shorter segments are not used
POINTS = 6  # samples per interpolated value
POSITIONS = np.arange(POINTS)
BLOCK = 1 << 16  # rows handled at once, so that no temporary array is as large as the data
_DECIMALS = range(1, 10)


@dataclass(frozen=True)
class UniformClock:
    """A uniform clock: instants `start` + i · `step`, i = 0 … `count` − 1 [s]."""

    start: float
    step: float
    count: int
    jitters: bool

    def instants(self, first: int, last: int) -> Array:
        """(last − first,) instants from number `first` on [s]."""
        return self.start + self.step * np.arange(first, last, dtype=float)


def check_time(time: Array, file: Path) -> None:
    """InputError naming the row unless `time` (N,) increases strictly and is long enough."""
    if len(time) < SHORTEST:
        found = "no rows" if len(time) == 0 else f"too few rows: {len(time)}"
        raise InputError(f"{found}, expected at least {SHORTEST} samples", file=file)
    backward = np.flatnonzero(time[1:] <= time[:-1])
    if len(backward):
        i = int(backward[0])
        what = "repeats" if time[i + 1] == time[i] else "decreases to"
        after = "" if time[i + 1] == time[i] else f" after {time[i]:.9g}"
        more = f" ({len(backward)} such rows)" if len(backward) > 1 else ""
        message = f"time {what} {time[i + 1]:.9g}{after}{more}, expected strictly increasing seconds"
        raise InputError(message, file=file, place=f"row {row_name(file, i + 1)}, column time")


def pieces(time: Array) -> list[slice]:
    """Stretches of `time` (N,) without gaps."""
    steps = np.diff(time)
    cuts = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    edges = [0, *(int(cut) for cut in cuts), len(time)]
    return [slice(first, last) for first, last in pairwise(edges)]


def find_clock(time: Array) -> UniformClock:
    """The uniform clock of a stretch of `time` (N,), or the one to resample to where it jitters."""
    span, last = float(time[-1] - time[0]), len(time) - 1
    start, step = float(time[0]), span / last
    if is_uniform(time, start, step):
        return UniformClock(start, step, last + 1, jitters=False)
    # the first and the last instant are rounded like all others: a line through all of them is closer
    centred = np.arange(last + 1) - last / 2
    step = float(centred @ (time - start)) / float(centred @ centred)
    middle = float(np.mean(time - start)) + start
    if is_uniform(time, middle - step * last / 2, step):
        return UniformClock(middle - step * last / 2, step, last + 1, jitters=False)
    steps = np.diff(time)
    usual = float(np.mean(steps[steps < 1.5 * np.median(steps)]))  # without the missing samples
    count = max(round(span / usual), SHORTEST)
    return UniformClock(start, span / count, count + 1, jitters=True)


def is_uniform(time: Array, start: float, step: float) -> bool:
    """Whether `time` is `start` + i · `step` up to what rounding explains (see the module's text)."""
    error = deviation(time, start, step)
    largest = float(max(abs(time[0]), abs(time[-1])))
    if error <= max(JITTER * step, 2 * np.spacing(largest)):
        return True
    if error <= np.spacing(np.float32(largest)) and np.array_equal(time, time.astype(np.float32)):
        return True
    return error <= 0.55 * decimal_resolution(time, step)


def deviation(time: Array, start: float, step: float) -> float:
    """Largest distance of `time` (N,) from `start` + i · `step` [s]."""
    largest = 0.0
    for begin in range(0, len(time), BLOCK):
        part = time[begin : begin + BLOCK]
        error = np.abs(part - start - step * np.arange(begin, begin + len(part)))
        largest = max(largest, float(np.max(error)))
    return largest


def decimal_resolution(time: Array, step: float) -> float:
    """10^-k where every instant has k decimals, which are finer than the step; else 0 [s]."""
    for decimals in _DECIMALS:
        unit = 10.0**-decimals
        if unit > 0.7 * step:  # with unit = step, a lost sample would pass for rounding
            continue
        tolerance = 4 * float(np.spacing(max(abs(time[0]), abs(time[-1]))))
        sample = time[:: max(1, len(time) // 1000)]
        if np.all(np.abs(np.round(sample, decimals) - sample) <= tolerance):
            return unit if np.all(np.abs(np.round(time, decimals) - time) <= tolerance) else 0.0
    return 0.0


@dataclass(frozen=True, eq=False)
class Segmented:
    """The uniform segments of a recording (views of its signals where possible), and what was done to it."""

    segments: tuple[Segment, ...]
    dropped: int = 0  # samples in stretches that are too short
    filled: int = 0  # single missing samples that were interpolated
    jitters: bool = False  # whether the instants deviate from a uniform clock apart from missing samples
    gaps: Bridged | None = None  # what was done to gaps


def make_segments(time: Array, signals: Array, n: int) -> Segmented:
    """Split and, where the clock jitters or samples are missing, resample.

    `time`: (N,) [s]; `signals`: (N, 2n) θ of every joint [rad], then τ [Nm]; overwritten when resampled.
    """
    segments: list[Segment] = []
    dropped, filled, jitters = 0, 0, False
    gaps = bridge(time, signals)
    time, signals = gaps.time, gaps.signals
    for piece in pieces(time):
        if piece.stop - piece.start < SHORTEST:
            dropped += piece.stop - piece.start
            continue
        recorded, values = time[piece], signals[piece]
        clock = find_clock(recorded)
        if clock.jitters:
            values = resample(recorded, values, clock)
            filled += int(np.count_nonzero(np.diff(recorded) > MISSING * clock.step))
            place = (recorded - clock.start) / clock.step
            jitters |= bool(np.max(np.abs(place - np.round(place))) > ROUNDED)
        exact = not clock.jitters and deviation(recorded, clock.start, clock.step) < 1e-9 * clock.step
        instants = recorded if exact else clock.instants(0, clock.count)
        segments.append(Segment(instants, values[:, :n], values[:, n:], clock.step))
    return Segmented(tuple(segments), dropped, filled, jitters, gaps)


def resample(time: Array, values: Array, clock: UniformClock) -> Array:
    """`values` (N, k) at `time`, interpolated at the instants of `clock`: (M, k), in place if M ≤ N."""
    in_place = clock.count <= len(time)
    result = values[: clock.count] if in_place else np.empty((values.shape[1], clock.count)).T
    # rows since … since + len(saved), of which the first are overwritten already
    saved, since = values[:0], 0

    def rows(low: int, high: int) -> Array:
        """Rows low … high as they were recorded."""
        until = since + len(saved)
        return np.concatenate([saved[low - since : high - since], values[max(low, until) : high]])

    for begin in range(0, clock.count, BLOCK):
        end = min(begin + BLOCK, clock.count)
        first, weights = stencil(time, clock.instants(begin, end))
        low, high = int(first[0]), int(first[-1]) + POINTS
        source = rows(low, high)
        if in_place:  # later blocks need nothing before this one's last stencil
            after = int(first[-1])
            saved, since = rows(after, max(high, end, since + len(saved))), after
        for column in range(values.shape[1]):
            around = source[first[:, None] - low + POSITIONS, column]
            result[begin:end, column] = np.einsum("mp,mp->m", weights, around)
    return result


def interpolate(time: Array, values: Array, wanted: Array) -> Array:
    """(M,) values (N,) at `time` (N,) interpolated at `wanted` (M,) by polynomials through six samples."""
    first, weights = stencil(time, wanted)
    return np.einsum("mp,mp->m", weights, values[first[:, None] + POSITIONS])


def stencil(time: Array, wanted: Array) -> tuple[Indices, Array]:
    """Index of the first of six samples around each of `wanted` (m,), and their Lagrange weights (m, 6)."""
    first = np.searchsorted(time, wanted, side="right") - POINTS // 2
    first = np.clip(first, 0, len(time) - POINTS)
    return first, lagrange_weights(time[first[:, None] + POSITIONS], wanted)
