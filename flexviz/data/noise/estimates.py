"""Measurement noise, estimated from the raw samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array
from flexviz.data.measurements import Segment
from flexviz.data.noise.counts import count_of
from flexviz.data.noise.repeats import repeats_of
from flexviz.data.noise.thresholds import THRESHOLDS

# Σ C(4, k)² = 70 is the variance of fourth differences of white noise of unit variance
DIFFERENCE_GAIN = np.sqrt(70.0)
UNIFORM = 1 / np.sqrt(12.0)  # standard deviation of rounding to steps of 1
RANGE_SAMPLES = 10_000  # of all segments together suffice for a range


def white_noise(y: Array) -> Array:
    """Standard deviation of the white noise in each column of y (shape (N, m)), shape (m,).

    The fourth difference removes any smooth motion; the median ignores the few samples at jumps. Where most
    differences are zero (a coarse encoder at rest) their standard deviation without outliers is used instead.
    Of a signal that repeats each value, as one recorded more slowly, only the new values count; held for k
    samples, their noise is as strong at low frequencies as white noise √k times as large. Counts are rounded:
    their error is at least uniform.
    """
    return np.array([_white_noise(column) for column in y.T])


def _white_noise(column: Array) -> float:
    y, held = new_values(column)
    difference = np.abs(np.diff(y, 4))
    if not len(difference):
        return 0.0
    robust = float(np.median(difference)) / 0.6745
    rounding = THRESHOLDS.rounding * float(np.max(np.abs(y)))
    if robust <= rounding:
        robust = _spread(difference, rounding)
    return float(max(np.sqrt(held) * robust / DIFFERENCE_GAIN, UNIFORM * count_of(column)))


def sudden_noise(y: Array) -> Array:
    """White noise as strong as all that changes from sample to sample, spikes and steps too, shape (m,)."""

    def of(column: Array) -> float:
        fresh, held = new_values(column)
        difference = np.diff(fresh, 4)
        return float(np.sqrt(held * np.mean(difference**2))) / DIFFERENCE_GAIN if len(difference) else 0.0

    return np.array([of(column) for column in y.T])


def _spread(difference: Array, rounding: float) -> float:
    """Of absolute differences that are mostly zero up to rounding, shape (N,), without outliers."""
    counted = difference[difference > rounding]
    if not len(counted):
        return 0.0
    usual = difference <= THRESHOLDS.outlier * np.median(counted)
    return float(np.sqrt(np.mean(difference[usual] ** 2)))


def new_values(column: Array) -> tuple[Array, float]:
    """A column (N,) without repetitions, and how many samples each value lasts."""
    found = repeats_of(column)
    return (column[found.rows], found.lasts) if found.lasts > 1.0 else (column, 1.0)


def resolution(segments: Sequence[Segment]) -> tuple[Array, Array]:
    """Rounding error of the best sensors of θ [rad] and τ [Nm], two arrays of shape (n,).

    A position is known to 2⁻²⁴ of a turn at best, a torque to 2⁻¹⁸ of its range: smaller noise has been
    filtered away, or was never simulated.
    """
    stride = max(1, sum(map(len, segments)) // RANGE_SAMPLES)
    tau = np.concatenate([s.tau[::stride] for s in segments])
    low, high = np.quantile(tau, (THRESHOLDS.range_tail, 1 - THRESHOLDS.range_tail), axis=0)
    theta = np.full(tau.shape[1], THRESHOLDS.position_resolution)
    return UNIFORM * theta, UNIFORM * THRESHOLDS.torque_resolution * (high - low)


def segments_noise(segments: Sequence[Segment]) -> tuple[Array, Array]:
    """Noise of θ [rad] and τ [Nm] over several segments (root mean square), two arrays of shape (n,).

    Nowhere below the `resolution` of the best sensors.
    """
    weights = np.array([len(s) for s in segments], float)
    theta = np.array([white_noise(s.theta) for s in segments])
    tau = np.array([white_noise(s.tau) for s in segments])
    least = resolution(segments)
    return (
        np.maximum(np.sqrt(np.average(theta**2, axis=0, weights=weights)), least[0]),
        np.maximum(np.sqrt(np.average(tau**2, axis=0, weights=weights)), least[1]),
    )
