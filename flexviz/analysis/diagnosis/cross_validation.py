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

from flexviz.analysis.estimation import score_covariance

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

FOLDS = 5


@dataclass(frozen=True)
class Folds:
    """Blocks of time, each in one fold.

    Attributes:
        fold: shape (N,), 0 … FOLDS − 1; −1 for samples that are not used.
        train: shape (FOLDS, N), training samples of each fold: those of other folds beyond the gap.
        block: shape (N,), index within each stretch; 0 for samples that are not used.
        gap: samples between training and test.
        stretches: contiguous samples that are used.
    """

    fold: Ints
    train: Bools
    block: Ints
    gap: int
    stretches: tuple[slice, ...]


def make_folds(used: Bools, stretches: Sequence[slice], gap: int) -> Folds:
    """Folds of samples (N,) whose noise is uncorrelated after `gap` samples, a third of a block."""
    found = [(rows.start, np.flatnonzero(used[rows])) for rows in stretches]
    kept = tuple(slice(int(at + i[0]), int(at + i[-1]) + 1) for at, i in found if len(i))
    kept = kept or tuple(stretches)
    fold, block = np.full(len(used), -1), np.zeros(len(used), int)
    train, blocks = np.zeros((FOLDS, len(used)), bool), 0
    for rows in kept:
        count = rows.stop - rows.start
        at = np.arange(count)
        block[rows] = at * max(1, round(count / (3 * gap))) // count
        fold[rows] = (blocks + block[rows]) % FOLDS
        blocks += int(block[rows.stop - 1]) + 1
        for k in range(FOLDS):
            before = np.r_[0, np.cumsum(fold[rows] == k)]
            near = before[np.minimum(at + gap + 1, count)] - before[np.maximum(at - gap, 0)]
            train[k, rows] = near == 0
    return Folds(fold, train, block, gap, kept)


@dataclass(frozen=True)
class ExplainedShare:
    """Share of a residual's mean square explained out of sample, its error, and each sample's part (N,)."""

    share: float
    std: float
    product: Array

    def of(self, residual: Array, here: Bools) -> float:
        """Share within the samples `here`, shape (N,)."""
        size, whole = float(np.sum(residual[here] ** 2)), float(np.sum(residual**2))
        return float(self.product[here].sum()) * whole / size if size > 0 else 0.0


def explained(index: Ints, residual: Array, folds: Folds) -> ExplainedShare:
    """Share of a residual, shape (N,) [Nm], explained by its mean in each bin; `index` of shape (N,)."""
    bins, prediction = int(index.max()) + 1, np.zeros(len(residual))
    for k, train in enumerate(folds.train):
        test, count = folds.fold == k, np.bincount(index[train], minlength=bins)
        mean = np.bincount(index[train], residual[train], bins) / np.maximum(count, 1)
        prediction[test] = mean[index[test]]
    return explained_by_prediction(prediction, residual, folds)


def explained_in_time(residual: Array, folds: Folds) -> ExplainedShare:
    """Share of a residual, shape (N,), explained by the blocks before and after, interpolated linearly."""
    prediction = np.zeros(len(residual))
    for rows in folds.stretches:
        at = np.arange(rows.start, rows.stop)
        for k, train in enumerate(folds.train):
            known, test = at[train[rows]], at[folds.fold[rows] == k]
            count = np.bincount(folds.block[known])
            centre, mean = (np.bincount(folds.block[known], v)[count > 0] for v in (known, residual[known]))
            if len(known):
                prediction[test] = np.interp(test, centre / count[count > 0], mean / count[count > 0])
    return explained_by_prediction(prediction, residual, folds)


def explained_by_prediction(prediction: Array, residual: Array, folds: Folds) -> ExplainedShare:
    """Share explained by an out-of-fold prediction, shape (N,), of the residual, shape (N,)."""
    used = folds.fold >= 0
    product = np.where(used, prediction * residual, 0.0) / max(float(np.sum(residual[used] ** 2)), 1e-300)
    # sums over blocks are independent but for each pair of blocks occurring twice, with the roles of training
    # and test exchanged: hence the factor 2
    sums = np.bincount(np.cumsum(np.r_[0, np.diff(folds.fold) != 0]), product)
    return ExplainedShare(float(product.sum()), float(np.sqrt(2 * len(sums)) * sums.std()), product)


def shortest_run(strength: Array) -> slice:
    """Shortest run of bins that contains half of the positive part of `strength`, shape (B,)."""
    total = np.r_[0.0, np.cumsum(np.maximum(strength, 0.0))]
    if total[-1] <= 0:
        return slice(0, len(strength))
    ends = np.searchsorted(total, total + 0.5 * total[-1] * (1 - 1e-9))
    lengths = np.where(ends < len(total), ends - np.arange(len(total)), len(total))
    first = int(np.argmin(lengths))
    return slice(first, int(ends[first]))


def mean_and_error(index: Ints, residual: Array, bins: int, folds: Folds) -> tuple[Array, Array, Ints]:
    """Mean of a residual (N,) [Nm] in each bin, its standard error, number of samples, shape (B,) each.

    NaN in empty bins. `index`: shape (N,). Samples are correlated: by the spectrum of what the means leave.
    """
    inside = (index[:, None] == np.arange(bins)) & (folds.fold >= 0)[:, None]
    count = inside.sum(axis=0)
    mean = residual @ inside / np.maximum(count, 1)
    rest = np.where(folds.fold >= 0, residual - mean[index], 0.0)
    variance = np.diag(score_covariance(rest[:, None], inside[:, None].astype(float), folds.stretches))
    std = np.sqrt(np.maximum(variance, 0.0)) / np.maximum(count, 1)
    mean[count == 0] = std[count == 0] = np.nan
    return mean, std, count
