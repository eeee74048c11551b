"""How much of a residual something explains, tested on samples that had no part in it.

A prediction p is fitted on some blocks of time and compared with the residual r of others:

    share = Σ_test r · p_train / Σ r²

Where r is noise, r and p are independent and the share is zero on average, however free the prediction is
(the usual 1 − Σ(r − p)² / Σ r² would be negative); where there is something, it is the share that is
explained. Training samples closer to a test block than the noise's memory are left out, or coloured noise
would explain itself.
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
# over which the remainder's spectrum is averaged: enough to follow it, few enough to scatter little; on a set
# of two joints 32 and 128 change the standard errors of the maps by at most 6 %, and no verdict
SMOOTHED_BANDS = 64
LONGEST_MEMORY = 12  # of a stretch, the most that blocks can be kept apart


@dataclass(frozen=True)
class Folds:
    """Blocks of time, each in one fold.

    Attributes:
        fold: shape (N,), 0 … FOLDS − 1; −1 for samples that are not used.
        train: shape (FOLDS, N), samples that may explain a fold: of other folds, and not next to it.
        window: shape (N,), windows of time, two blocks long, counted within each stretch.
        gap: samples after which the residual has forgotten itself.
        stretches: which samples are contiguous.
    """

    fold: Ints
    train: NDArray[np.bool_]
    window: Ints
    gap: int
    stretches: tuple[slice, ...]

    @property
    def used(self) -> NDArray[np.bool_]:
        """Samples that are used, shape (N,)."""
        return self.fold >= 0


def memory(residual: Array, stretches: Sequence[slice], longest: int) -> int:
    """Number of samples after which a residual (shape (N,)) has forgotten itself, at most `longest`."""
    total = np.zeros(longest + 1)
    for rows in stretches:
        part = residual[rows]
        length = fft.next_fast_len(len(part) + longest + 1, real=True)
        power = np.abs(fft.rfft(part, length)) ** 2
        total += fft.irfft(power, length)[: longest + 1]
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
        if blocks > 1 and blocks % 2:  # a last block alone joins the window before
            windows[rows] = np.minimum(index // 2, blocks // 2 - 1)
        at += blocks
        near = np.ones(2 * gap + 1)
        for k in range(FOLDS):
            mine = fold[rows] == k
            train[k, rows] = np.convolve(mine, near, mode="same")[:count] < 0.5 if gap < count else ~mine
    fold[~used] = -1
    train[:, ~used] = False
    return Folds(fold, train, windows, gap, tuple(stretches))


@dataclass(frozen=True)
class ExplainedShare:
    """What was explained out of sample.

    Attributes:
        share: of the residual's mean square; zero on average where there is nothing.
        std: its standard error.
        product: shape (N,), each sample's part of the share.
    """

    share: float
    std: float
    product: Array

    def of(self, residual: Array, here: NDArray[np.bool_]) -> float:
        """The share among the samples `here`, shape (N,)."""
        size = float(np.sum(residual[here] ** 2))
        whole = float(np.sum(residual**2))
        return float(self.product[here].sum()) * whole / size if size > 0 else 0.0


def explained(index: Ints, residual: Array, folds: Folds) -> ExplainedShare:
    """Share of a residual that its mean in bins explains.

    Args:
        index: shape (N,), the bin of each sample.
        residual: shape (N,) [Nm], zero where not used.
        folds: of that residual.
    """
    bins = int(index.max()) + 1
    prediction = np.zeros(len(residual))
    for k, train in enumerate(folds.train):
        test = folds.fold == k
        count = np.bincount(index[train], minlength=bins)
        mean = np.bincount(index[train], residual[train], bins) / np.maximum(count, 1)
        prediction[test] = mean[index[test]]
    return explained_by_prediction(prediction, residual, folds)


def explained_by_prediction(prediction: Array, residual: Array, folds: Folds) -> ExplainedShare:
    """A prediction, each sample's from other folds, held against the residual; shape (N,) each."""
    used = folds.used
    size = max(float(np.sum(residual[used] ** 2)), 1e-300)
    product = np.where(used, prediction * residual, 0.0) / size
    # blocks of a fold are far from each other: their sums would be independent, did not every pair of
    # blocks meet twice, each time with the other as test
    block = np.cumsum(np.r_[0, np.diff(folds.fold) != 0])
    sums = np.bincount(block, product)
    spread = float(np.sqrt(2 * len(sums) / max(len(sums) - 1, 1) * np.sum((sums - sums.mean()) ** 2)))
    return ExplainedShare(float(product.sum()), spread, product)


def shortest_run(strength: Array, share: float = 0.5) -> slice:
    """The shortest run of bins that carries `share` of what is positive in `strength`, shape (B,)."""
    total = np.concatenate(([0.0], np.cumsum(np.maximum(strength, 0.0))))
    wanted = share * total[-1]
    best = slice(0, len(strength))
    if total[-1] <= 0:
        return best
    for first in range(len(strength)):
        last = int(np.searchsorted(total, total[first] + wanted - 1e-12 * total[-1]))
        if last <= len(strength) and last - first < best.stop - best.start:
            best = slice(first, last)
    return best


def mean_and_error(index: Ints, residual: Array, bins: int, folds: Folds) -> tuple[Array, Array, Ints]:
    """Binned mean, its standard error and the number of samples, shape (B,) each; NaN where there is none.

    The error is that of correlated samples: Σ_tu γ(t − u) / n² over a bin's samples, γ the autocovariance of
    what the means leave, by its smoothed spectrum.

    Args:
        index: shape (N,), the bin of each sample.
        residual: shape (N,) [Nm].
        bins: B.
        folds: where the samples are contiguous, and which are used.
    """
    used = folds.used
    count = np.bincount(index[used], minlength=bins)
    mean = np.bincount(index[used], residual[used], bins) / np.maximum(count, 1)
    length, power = remainder_spectrum(residual - mean[index], folds)
    variance = np.zeros(bins)
    for rows in folds.stretches:
        inside = np.zeros((rows.stop - rows.start, bins))
        inside[np.arange(len(inside)), index[rows]] = used[rows]
        seen = np.flatnonzero(inside.any(axis=0))
        spectrum = np.abs(fft.rfft(inside[:, seen], length, axis=0)) ** 2
        variance[seen] += power @ spectrum
    std = np.sqrt(variance) / np.maximum(count, 1)
    mean[count == 0] = std[count == 0] = np.nan
    return mean, std, count


def remainder_spectrum(rest: Array, folds: Folds) -> tuple[int, Array]:
    """Smoothed spectrum of what is left, such that Σ power · |rfft(y, length)|² = Σ_tu γ(t − u) y_t y_u.

    Returns:
        the transform's length and the power, shape (length // 2 + 1,).
    """
    rest = np.where(folds.used, rest, 0.0)
    length = fft.next_fast_len(2 * max(r.stop - r.start for r in folds.stretches), real=True)
    power = np.zeros(length // 2 + 1)
    for rows in folds.stretches:
        power += np.abs(fft.rfft(rest[rows], length)) ** 2
    power /= max(int(folds.used.sum()), 1)
    half = max(1, len(power) // SMOOTHED_BANDS)
    kernel = np.hanning(2 * half + 3)[1:-1]
    kernel /= kernel.sum()
    power = np.convolve(
        np.concatenate((power[half:0:-1], power, power[-2 : -half - 2 : -1])), kernel, "valid"
    )
    power *= 2.0 / length  # a real signal's spectrum is counted twice but for its ends
    power[0] /= 2
    if length % 2 == 0:
        power[-1] /= 2
    return length, power
