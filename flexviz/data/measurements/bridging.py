"""Gaps that are short against the content of the signals are interpolated; longer ones separate segments.

What an interpolation over a gap of this length misses is measured where nothing is missing: samples of the
recording itself are left out and predicted. Noise limits the prediction of a single sample already; a gap is
short while it is predicted nearly as well, or better than sensors resolve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Indices
from flexviz.data.measurements.data import Array

GAP = 2.75  # intervals longer than this many median ones are gaps
AS_WELL = 2.0  # times the error of a single predicted sample up to which a gap is predicted as well
RESOLVED = 1e-4  # of a signal's spread: smaller errors are below the resolution of ordinary sensors
NODES = 3  # samples at either side of a gap that predict it
SHARE = 0.9  # of the places at which a prediction has to be good: sharp reversals are few
PLACES = 400  # at which a prediction is tried
FEWEST = 20  # places that tell an error


@dataclass(frozen=True, eq=False)
class Bridged:
    """A recording with samples in its short gaps.

    Attributes:
        time: (N,) [s].
        signals: (N, k) at `time`.
        count: how many gaps were bridged.
        longest: the longest of them [s].
        left: how many gaps are left.
        longest_left: the longest of these [s].
    """

    time: Array
    signals: Array
    count: int = 0
    longest: float = 0.0
    left: int = 0
    longest_left: float = 0.0


def bridge(time: Array, signals: Array) -> Bridged:
    """Fill the short gaps of `signals` (N, k) at `time` (N,) [s]; unchanged where there are none."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    at = np.flatnonzero(steps > GAP * usual)
    if not len(at):
        return Bridged(time, signals)
    missing = np.maximum(np.round(steps[at] / usual).astype(int) - 1, 1)
    short = missing <= _longest_bridged(time, signals, missing, at)
    short &= (at >= _reach(missing)) & (at + 1 + _reach(missing) < len(time))
    reach, long = _reach(missing), at[~short]  # no polynomial through samples beyond a longer gap
    short &= np.searchsorted(long, at - reach) == np.searchsorted(long, at + reach + 1)
    filled = [_fill(time, signals, int(i), int(k)) for i, k in zip(at[short], missing[short], strict=True)]
    left = steps[at[~short]]
    if filled:
        before = np.repeat(at[short] + 1, missing[short])
        time = np.insert(time, before, np.concatenate([instants for instants, _ in filled]))
        signals = np.insert(signals, before, np.concatenate([values for _, values in filled]), axis=0)
    lengths = steps[at[short]].max(initial=0.0), left.max(initial=0.0)
    return Bridged(time, signals, len(filled), float(lengths[0]), len(left), float(lengths[1]))


def _longest_bridged(time: Array, signals: Array, missing: Indices, gaps: Indices) -> int:
    """The most missing samples that are predicted well enough, of those that occur; 0: none."""
    spread = np.std(signals, axis=0)
    single = _error(time, signals, 1, gaps)
    longest = 0
    for k in np.unique(missing):
        error = _error(time, signals, int(k), gaps)
        if single is None or error is None or np.any(error > np.maximum(AS_WELL * single, RESOLVED * spread)):
            break
        longest = int(k)
    return longest


def _error(time: Array, signals: Array, missing: int, gaps: Indices) -> Array | None:
    """(k,) error, in most places, of predicting the middle of `missing` samples; None with too few places."""
    reach = int(_reach(missing))
    first = np.arange(reach, len(time) - reach - missing - 1)  # the last sample before
    inside = np.searchsorted(gaps, first - reach)
    upper = np.searchsorted(gaps, first + missing + 1 + reach)
    first = first[inside == upper]
    if len(first) < FEWEST:
        return None
    first = first[:: max(1, len(first) // PLACES)]
    middle = first + (missing + 1) // 2
    predicted = _predicted(time, signals, first, missing, 0, time[middle])
    return np.quantile(np.abs(predicted - signals[middle]), SHARE, axis=0)


def _reach(missing: int | Indices) -> Indices:
    """Samples beyond the last one before a gap, and the first one after, that its prediction needs."""
    return (NODES - 1) * _stride(missing)


def _stride(missing: int | Indices) -> Indices:
    """Samples from node to node: half a gap, so that noise is not amplified in a long one."""
    return np.maximum(1, (np.asarray(missing) + 1) // 2)


def _predicted(time: Array, signals: Array, last: Indices, missing: int, gone: int, wanted: Array) -> Array:
    """(m, k) `signals` at `wanted` (m,) after the rows `last` (m,), by polynomials through six samples.

    `gone`: how many of the missing samples have no row.
    """
    before = -_stride(missing) * np.arange(NODES)[::-1]
    after = missing - gone + 1 + _stride(missing) * np.arange(NODES)
    rows = last[:, None] + np.concatenate([before, after])
    return np.einsum("mp,mpk->mk", lagrange_weights(time[rows], wanted), signals[rows])


def lagrange_weights(nodes: Array, wanted: Array) -> Array:
    """Weights (m, p) of the values at `nodes` (m, p) in the polynomials through them, at `wanted` (m,)."""
    weights, count = np.ones_like(nodes), nodes.shape[1]
    for i in range(count):
        for j in range(count):
            if i != j:
                weights[:, i] *= (wanted - nodes[:, j]) / (nodes[:, i] - nodes[:, j])
    return weights


def _fill(time: Array, signals: Array, last: int, missing: int) -> tuple[Array, Array]:
    """Instants (m,) in the gap after row `last`, and the signals there (m, k)."""
    instants = np.linspace(time[last], time[last + 1], missing + 2)[1:-1]
    rows = np.full(missing, last)
    return instants, _predicted(time, signals, rows, missing, missing, instants)
