"""How much of a residual a variable explains, judged on samples that had no part in the explanation.

The residual's mean in bins of the variable, m, is formed on some blocks of time and compared with others:

    share = Σ_test r · m_train / Σ r²

Where r is noise, r and m are independent and the share is zero on average, however many bins there are (the
usual 1 − Σ(r − m)² / Σ r² would be negative); where there is a curve, the share is what the curve explains.
Training samples closer to a test block than the noise's memory are left out, or coloured noise would explain
itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz._scipy import fft

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

FOLDS = 5
MEMORIES = 3.0  # times the lag at which the autocorrelation has fallen to 1/e: there it is forgotten
WINDOWS = 8  # of time in one stretch, unless the noise's memory asks for longer ones
LONGEST_MEMORY = 12  # of a stretch, the most that blocks can be kept apart
BINS = 24
SAMPLES_PER_BIN = 40  # at least, on average
CARRIED = 0.5  # a range that carries most: the shortest one with this share


@dataclass(frozen=True)
class Folds:
    """Blocks of time, each in one fold.

    Attributes:
        fold: shape (N,), 0 … FOLDS − 1; −1 for samples that are not used.
        train: shape (FOLDS, N), samples that may explain a fold: of other folds, and not next to it.
        window: shape (N,), windows of time, two blocks long, counted within each stretch.
        stretches: which samples are contiguous.
    """

    fold: Ints
    train: NDArray[np.bool_]
    window: Ints
    stretches: tuple[slice, ...]


def memory(residual: Array, stretches: Sequence[slice], longest: int) -> int:
    """Number of samples after which a residual (shape (N,)) has forgotten itself, at most `longest`."""
    total = np.zeros(longest + 1)
    for rows in stretches:
        part = residual[rows]
        length = fft.next_fast_len(len(part) + longest + 1, real=True)
        power = np.abs(fft.rfft(part, length)) ** 2
        found = fft.irfft(power, length)[: longest + 1]
        total[: len(found)] += found
    if total[0] <= 0:
        return 1
    small = np.flatnonzero(np.abs(total) < np.exp(-1) * total[0])
    return min(longest, int(np.ceil(MEMORIES * small[0]))) if small.size else longest


def make_folds(residual: Array, used: NDArray[np.bool_], stretches: Sequence[slice]) -> Folds:
    """Folds for a residual, shape (N,): blocks long against its memory, short against the stretches."""
    longest = max(r.stop - r.start for r in stretches)
    window = max(8, longest // WINDOWS)
    # its memory is that of what is left when everything slow is taken off: a contact is no noise
    quick = residual * used
    for rows in stretches:
        index = np.arange(rows.stop - rows.start) // window
        weight = np.maximum(np.bincount(index, used[rows]), 1)
        quick[rows] -= used[rows] * (np.bincount(index, quick[rows]) / weight)[index]
    gap = memory(quick, stretches, max(1, longest // LONGEST_MEMORY))
    block = max(window // 2, 3 * gap, 4)
    fold = np.full(len(residual), -1)
    windows = np.zeros(len(residual), int)
    train = np.zeros((FOLDS, len(residual)), bool)
    at = 0
    for rows in stretches:
        count = rows.stop - rows.start
        blocks = max(1, round(count / block))
        index = np.arange(count) * blocks // count
        fold[rows] = (at + index) % FOLDS
        windows[rows] = index // 2
        if blocks > 1 and blocks % 2:
            windows[rows] = np.minimum(index // 2, blocks // 2 - 1)  # a last block alone joins the one before
        at += blocks
        near = np.ones(2 * gap + 1)
        for k in range(FOLDS):
            mine = fold[rows] == k
            train[k, rows] = np.convolve(mine, near, mode="same")[:count] < 0.5 if gap < count else ~mine
    fold[~used] = -1
    train[:, ~used] = False
    return Folds(fold, train, windows, tuple(stretches))


@dataclass(frozen=True)
class Explained:
    """What bins of a variable explain.

    Attributes:
        share: of the residual's mean square, out of sample; zero on average where there is nothing.
        std: its standard error.
        strength: shape (B,), each bin's part of the share.
        prediction: shape (N,), out of sample [Nm]; zero where a bin was never seen in training.
    """

    share: float
    std: float
    strength: Array
    prediction: Array


def explained(index: Ints, residual: Array, folds: Folds) -> Explained:
    """Share of a residual that its mean in bins explains.

    Args:
        index: shape (N,), the bin of each sample.
        residual: shape (N,) [Nm].
        folds: of that residual.
    """
    bins = int(index.max()) + 1
    prediction = np.zeros(len(residual))
    for k, train in enumerate(folds.train):
        test = folds.fold == k
        count = np.bincount(index[train], minlength=bins)
        mean = np.bincount(index[train], residual[train], bins) / np.maximum(count, 1)
        prediction[test] = mean[index[test]]
    used = folds.fold >= 0
    product = np.where(used, prediction * residual, 0.0)
    size = max(float(np.sum(residual[used] ** 2)), 1e-300)
    # blocks of a fold are far from each other: their sums would be independent, did not every pair of
    # blocks meet twice, each time with the other as test
    block = np.cumsum(np.r_[0, np.diff(folds.fold) != 0])
    sums = np.bincount(block, product)
    spread = float(np.sqrt(2 * len(sums) / max(len(sums) - 1, 1) * np.sum((sums - sums.mean()) ** 2)))
    strength = np.bincount(index, product, bins) / size
    return Explained(float(strength.sum()), spread / size, strength, prediction)


def quantile_bins(variable: Array, used: NDArray[np.bool_], bins: int) -> tuple[Ints, Array]:
    """Bins with about equally many samples: their index, shape (N,), and edges, shape (B + 1,)."""
    edges = np.unique(np.quantile(variable[used], np.linspace(0, 1, bins + 1)))
    if len(edges) < 2:
        edges = np.array([edges[0], edges[0] + 1e-9])
    index = np.clip(np.searchsorted(edges, variable, side="right") - 1, 0, len(edges) - 2)
    return index, edges


def bin_count(samples: int) -> int:
    """How many bins so many samples are worth."""
    return int(np.clip(samples // SAMPLES_PER_BIN, 4, BINS))


def carrying(strength: Array) -> slice:
    """The shortest run of bins that carries most of the strength, shape (B,)."""
    total = np.concatenate(([0.0], np.cumsum(np.maximum(strength, 0.0))))
    wanted = CARRIED * total[-1]
    best = slice(0, len(strength))
    if total[-1] <= 0:
        return best
    for first in range(len(strength)):
        last = int(np.searchsorted(total, total[first] + wanted - 1e-12 * total[-1]))
        if last <= len(strength) and last - first < best.stop - best.start:
            best = slice(first, last)
    return best


def mean_and_error(
    index: Ints, residual: Array, curve: Array, folds: Folds, bins: int
) -> tuple[Array, Array, Ints]:
    """Binned mean, its standard error and the number of samples, shape (B,) each.

    The error is that of correlated samples: Σ_tu γ(t − u) / n² over a bin's samples, γ the autocovariance of
    what the curve leaves, by its smoothed spectrum.

    Args:
        index: shape (N,).
        residual: shape (N,) [Nm].
        curve: shape (N,), the mean that is taken off before the autocovariance is estimated.
        folds: where the samples are contiguous, and which are used.
        bins: B.
    """
    used = folds.fold >= 0
    count = np.bincount(index[used], minlength=bins)
    mean = np.bincount(index[used], residual[used], bins) / np.maximum(count, 1)
    rest = np.where(used, residual - curve, 0.0)
    longest = max(r.stop - r.start for r in folds.stretches)
    length = fft.next_fast_len(2 * longest, real=True)
    power = np.zeros(length // 2 + 1)
    for rows in folds.stretches:
        power += np.abs(fft.rfft(rest[rows], length)) ** 2
    power /= max(int(used.sum()), 1)
    half = max(1, len(power) // 64)
    kernel = np.hanning(2 * half + 3)[1:-1]
    power = np.convolve(np.concatenate((power[half:0:-1], power, power[-2 : -half - 2 : -1])), kernel, "valid")
    power /= kernel.sum()
    weight = np.full(len(power), 2.0 / length)
    weight[0] /= 2
    if length % 2 == 0:
        weight[-1] /= 2
    variance = np.zeros(bins)
    for rows in folds.stretches:
        inside = np.zeros((rows.stop - rows.start, bins))
        inside[np.arange(len(inside)), index[rows]] = used[rows]
        seen = np.flatnonzero(inside.any(axis=0))
        spectrum = np.abs(fft.rfft(inside[:, seen], length, axis=0)) ** 2
        variance[seen] += (weight * power) @ spectrum
    std = np.sqrt(variance) / np.maximum(count, 1)
    std[count == 0] = np.nan
    mean[count == 0] = np.nan
    return mean, std, count
