"""Cross-validated share of a residual that a prediction explains.

A prediction p is fitted on some blocks of time and compared with the residual r of others:

    share = Σ_test r · p_train / Σ r²

For pure noise, r and p are independent and the share is zero on average, however flexible the prediction
(1 − Σ(r − p)² / Σ r² would be negative). Training samples within the correlation time of a test block are
left out, because coloured noise predicts itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.fourier import quick_length

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

FOLDS = 5
GAP_CORRELATION_TIMES = 3.0  # gap between blocks, relative to the lag of autocorrelation 1/e
WINDOWS_PER_STRETCH = 8  # fewer where the noise is correlated for longer
# bands of the smoothed spectrum of the remainder; on a two-joint set, 32 and 128 change the standard errors
# of the maps by at most 6 % and no verdict
SMOOTHED_BANDS = 64
MAX_GAP_DIVISOR = 12  # the gap is at most this fraction of the longest stretch


@dataclass(frozen=True)
class Folds:
    """Blocks of time, each in one fold.

    Attributes:
        fold: shape (N,), 0 … FOLDS − 1; −1 for samples that are not used.
        train: shape (FOLDS, N), training samples of each fold: those of other folds beyond the gap.
        window: shape (N,), index of the time window, two blocks long, within each stretch.
        gap: samples after which the residual is uncorrelated.
        stretches: contiguous samples.
    """

    fold: Ints
    train: NDArray[np.bool_]
    window: Ints
    gap: int
    stretches: tuple[slice, ...]

    @property
    def used(self) -> NDArray[np.bool_]:
        """Samples in a fold, shape (N,)."""
        return self.fold >= 0


def memory(residual: Array, stretches: Sequence[slice], longest: int) -> int:
    """Samples after which a residual, shape (N,), is uncorrelated; at most `longest`."""
    total = np.zeros(longest + 1)
    for rows in stretches:
        part = residual[rows]
        length = quick_length(len(part) + longest + 1)
        power = np.abs(np.fft.rfft(part, length)) ** 2
        total += np.fft.irfft(power, length)[: longest + 1]
    if total[0] <= 0:
        return 1
    small = np.flatnonzero(np.abs(total) < np.exp(-1) * total[0])
    return min(longest, int(np.ceil(GAP_CORRELATION_TIMES * small[0]))) if small.size else longest


def make_folds(residual: Array, used: NDArray[np.bool_], stretches: Sequence[slice]) -> Folds:
    """Folds for a residual, shape (N,): blocks longer than its correlation time, shorter than a stretch."""
    longest = max(r.stop - r.start for r in stretches)
    window = max(8, longest // WINDOWS_PER_STRETCH)
    # the correlation time is that of the fast part: a slow disturbance, such as a contact, is not noise
    quick = residual * used
    for rows in stretches:
        index = np.arange(rows.stop - rows.start) // window
        weight = np.maximum(np.bincount(index, used[rows]), 1)
        quick[rows] -= used[rows] * (np.bincount(index, quick[rows]) / weight)[index]
    gap = memory(quick, stretches, max(1, longest // MAX_GAP_DIVISOR))
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
    """Share of a residual's mean square explained out of sample; zero on average for noise.

    Attributes:
        share: total over all samples.
        std: its standard error.
        product: shape (N,), contribution of each sample.
    """

    share: float
    std: float
    product: Array

    def of(self, residual: Array, here: NDArray[np.bool_]) -> float:
        """Share within the samples `here`, shape (N,)."""
        size = float(np.sum(residual[here] ** 2))
        whole = float(np.sum(residual**2))
        return float(self.product[here].sum()) * whole / size if size > 0 else 0.0


def explained(index: Ints, residual: Array, folds: Folds) -> ExplainedShare:
    """Share of a residual, shape (N,) [Nm], explained by its mean in each bin; `index` of shape (N,)."""
    bins = int(index.max()) + 1
    prediction = np.zeros(len(residual))
    for k, train in enumerate(folds.train):
        test = folds.fold == k
        count = np.bincount(index[train], minlength=bins)
        mean = np.bincount(index[train], residual[train], bins) / np.maximum(count, 1)
        prediction[test] = mean[index[test]]
    return explained_by_prediction(prediction, residual, folds)


def explained_by_prediction(prediction: Array, residual: Array, folds: Folds) -> ExplainedShare:
    """Share explained by an out-of-fold prediction, shape (N,), of the residual, shape (N,)."""
    used = folds.used
    size = max(float(np.sum(residual[used] ** 2)), 1e-300)
    product = np.where(used, prediction * residual, 0.0) / size
    # sums over blocks are independent but for each pair of blocks occurring twice, with the roles of training
    # and test exchanged: hence the factor 2
    block = np.cumsum(np.r_[0, np.diff(folds.fold) != 0])
    sums = np.bincount(block, product)
    spread = float(np.sqrt(2 * len(sums) / max(len(sums) - 1, 1) * np.sum((sums - sums.mean()) ** 2)))
    return ExplainedShare(float(product.sum()), spread, product)


def shortest_run(strength: Array, share: float = 0.5) -> slice:
    """Shortest run of bins that contains `share` of the positive part of `strength`, shape (B,)."""
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
    """Binned mean, its standard error and the number of samples, shape (B,) each; NaN in empty bins.

    The standard error accounts for correlated samples: Σ_tu γ(t − u) / n² over the samples of a bin, γ being
    the autocovariance of the remainder, from its smoothed spectrum.

    Args:
        index: shape (N,), bin of each sample.
        residual: shape (N,) [Nm].
        bins: B.
        folds: of the residual.
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
        spectrum = np.abs(np.fft.rfft(inside[:, seen], length, axis=0)) ** 2
        variance[seen] += power @ spectrum
    std = np.sqrt(variance) / np.maximum(count, 1)
    mean[count == 0] = std[count == 0] = np.nan
    return mean, std, count


def remainder_spectrum(rest: Array, folds: Folds) -> tuple[int, Array]:
    """Smoothed spectrum of a remainder, such that Σ power · |rfft(y, length)|² = Σ_tu γ(t − u) y_t y_u.

    Returns:
        length of the transform; power, shape (length // 2 + 1,).
    """
    rest = np.where(folds.used, rest, 0.0)
    length = quick_length(2 * max(r.stop - r.start for r in folds.stretches))
    power = np.zeros(length // 2 + 1)
    for rows in folds.stretches:
        power += np.abs(np.fft.rfft(rest[rows], length)) ** 2
    power /= max(int(folds.used.sum()), 1)
    half = max(1, len(power) // SMOOTHED_BANDS)
    kernel = np.hanning(2 * half + 3)[1:-1]
    kernel /= kernel.sum()
    power = np.convolve(
        np.concatenate((power[half:0:-1], power, power[-2 : -half - 2 : -1])), kernel, "valid"
    )
    power *= 2.0 / length  # one-sided spectrum: all but the first and last line count twice
    power[0] /= 2
    if length % 2 == 0:
        power[-1] /= 2
    return length, np.asarray(power, float)
