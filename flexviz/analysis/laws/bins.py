"""Bins of a law's variable, and the means of a law over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Indices


@dataclass(frozen=True, eq=False)
class BinnedLaw:
    """Mean of a law in the bins that hold enough; arrays have shape (B,)."""

    bins: Indices
    at: Array
    law: Array
    std: Array
    count: Array


class Means:
    """Means of a law over bins: u (N,) and its slopes (P, N) in every stretch, divided by `per` (N,)."""

    def __init__(
        self, at: list[Array], per: list[Array], u: list[Array], slopes: list[Array], covariance: Array
    ) -> None:
        self._at, self._per = np.concatenate(at), np.concatenate(per)
        self._u, self._slopes = np.concatenate(u), np.concatenate(slopes, axis=1)
        self._covariance = covariance

    def of(self, index: list[Indices], bins: int, fewest: int) -> BinnedLaw:
        """The means in the bins with at least `fewest` instants; index: bin of every instant, −1 for none."""
        whole = np.concatenate(index)
        inside = whole >= 0

        def sums(column: Array) -> Array:
            return np.bincount(whole[inside], column[inside], bins).astype(float)

        count, power = sums(np.ones(len(whole))), sums(self._per**2)
        used = (count >= fewest) & (power > 0)
        law = sums(self._u * self._per)[used] / power[used]
        slope = np.array([sums(row * self._per)[used] / power[used] for row in self._slopes])
        variance = np.einsum("pb,pq,qb->b", slope, self._covariance, slope)
        centres = sums(self._at)[used] / count[used]
        std = np.sqrt(np.maximum(variance, 0.0))
        return BinnedLaw(np.flatnonzero(used), centres, law, std, count[used])


def path_length(values: Array) -> float:
    """Sum of all rises and falls of values (B,)."""
    return float(np.abs(np.diff(values)).sum())


def tukey(count: int, taper: float) -> Array:
    """A window of `count` samples that rises over `taper` samples, shape (N,)."""
    edge = np.clip((np.minimum(np.arange(count), np.arange(count)[::-1]) + 0.5) / max(taper, 1e-9), 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * edge)


def binned(at: list[Array], per: list[Array], bins: int) -> list[Indices]:
    """Bin of every instant, −1 for none: edges midway between equally wide and equally filled; one at 0."""
    whole = np.concatenate(at)
    seen = np.isfinite(whole) & (np.concatenate(per) != 0)
    values = whole[seen] if seen.any() else np.zeros(1)
    share = np.linspace(0, 1, bins + 1)
    edges = 0.5 * (np.quantile(values, share) + values.min() + share * np.ptp(values))
    if edges[0] < 0 < edges[-1]:
        edges[1 + np.argmin(np.abs(edges[1:-1]))] = 0.0
    edges = np.sort(edges)
    out = []
    for one, by in zip(at, per, strict=True):
        index = np.clip(np.searchsorted(edges, np.nan_to_num(one), side="right") - 1, 0, bins - 1)
        out.append(np.where(np.isfinite(one) & (by != 0), index, -1))
    return out
