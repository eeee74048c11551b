"""Weighting of a stretch by its noise and by the unknown torque at reversals.

The unknown torque at reversals (`pulses`) adds a few columns V of unknown size: the whitened covariance
becomes 1 + V Vᵀ, and a symmetric square root of its inverse is P = 1 − U (1 − (1 + S²)^(−½)) Uᵀ with V = U S
….
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation.whitening import Whitener
from flexviz.base.arrays import Array
from flexviz.model.equation import PulseGroup


@dataclass(frozen=True)
class UnknownPart:
    """Whitened unknown columns V of a part of a stretch, in their principal directions V = U S ….

    Attributes:
        rows: samples of the stretch.
        columns: (rows, columns) each: V is zero elsewhere. A pulse is short, so that U would take many times
            the memory.
        turn: shape (M, K), U = V turn.
        size: shape (K,), S.
    """

    rows: slice
    columns: tuple[tuple[slice, Array], ...]
    turn: Array
    size: Array

    def along(self, y: Array) -> Array:
        """Uᵀ y for y of shape (N·n, P) within the part: shape (K, P)."""
        return self.turn.T @ np.concatenate([columns.T @ y[rows] for rows, columns in self.columns])

    def subtract(self, sizes: Array, y: Array) -> None:
        """Subtract U sizes, sizes of shape (K, P), from y of shape (N·n, P), in place."""
        sizes, at = self.turn @ sizes, 0
        for rows, columns in self.columns:
            y[rows] -= columns @ sizes[at : at + columns.shape[1]]
            at += columns.shape[1]


@dataclass(frozen=True)
class NoiseWeighting:
    """W: y → samples of unit variance, for one stretch.

    Attributes:
        whitener: of the measurement noise.
        unknown: unknown columns of parts of the stretch that do not overlap.
    """

    whitener: Whitener
    unknown: tuple[UnknownPart, ...] = ()

    def with_unknown(self, groups: Sequence[PulseGroup], rows: slice) -> NoiseWeighting:
        """The same with unknown columns in samples without any before.

        Args:
            groups: the columns, each of unit variance.
            rows: samples of the stretch in which they count.
        """
        white = [whitened(self.whitener, group, rows) for group in groups]
        n = groups[0].columns.shape[1]
        columns = tuple(
            (slice(n * first, n * (first + len(part))), part.reshape(-1, part.shape[2]))
            for first, part in white
        )
        # via the small Gram matrix: directions of negligible size are dropped
        squares, turn = np.linalg.eigh(_gram(columns))
        kept = squares > 1e-6 * max(float(squares[-1]), 1e-300)
        size = np.sqrt(squares[kept])
        part = UnknownPart(rows, columns, turn[:, kept] / size, size)
        return NoiseWeighting(self.whitener, (*self.unknown, part))

    def apply(self, y: Array) -> Array:
        """P W y for y of shape (N, n) or (N, n, P): the same shape."""
        return self._project(self.whitener.apply(y))

    def transposed(self, y: Array) -> Array:
        """(P W)ᵀ y for y of shape (N, n, P): the same shape."""
        return self.whitener.transposed(self._project(y.copy()))

    def unknown_share(self, y: Array) -> Array:
        """yᵀ P V: effect of the unknown columns on the score of instruments y (N, n, P), shape (P, M)."""
        out = [np.zeros((y.shape[2], 0))]
        for part in self.unknown:
            along = part.along(y[part.rows].reshape(-1, y.shape[2]))
            out.append(along.T * (part.size / np.sqrt(1 + part.size**2)))
        return np.concatenate(out, axis=1)

    @property
    def log_determinant(self) -> float:
        """log det(1 + V Vᵀ): cost of the unknown columns in twice the log likelihood."""
        return sum(float(np.log1p(part.size**2).sum()) for part in self.unknown)

    def _project(self, y: Array) -> Array:
        """P y, in place."""
        for part in self.unknown:
            rows = y[part.rows].reshape((part.rows.stop - part.rows.start) * y.shape[1], -1)
            shrink = 1 - 1 / np.sqrt(1 + part.size**2)
            part.subtract(shrink[:, None] * part.along(rows), rows)
        return y


def whitened(whitener: Whitener, group: PulseGroup, rows: slice) -> tuple[int, Array]:
    """Whitened columns in some rows of a stretch: the first of `rows` where they are not zero, (R, n, M)."""
    begin, columns = group.first, group.columns
    # whitening looks back: it carries them on by its order
    longer = np.zeros((min(len(columns) + whitener.order, rows.stop - begin), *columns.shape[1:]))
    longer[: len(columns)] = columns
    first = max(rows.start - begin, 0)
    return begin + first - rows.start, whitener.apply(longer, begin)[first:]


def _gram(columns: Sequence[tuple[slice, Array]]) -> Array:
    """VᵀV of columns V that are zero outside their rows, shape (M, M)."""
    ends = np.cumsum([0, *(part.shape[1] for _, part in columns)])
    starts, stops = (np.array([getattr(rows, end) for rows, _ in columns]) for end in ("start", "stop"))
    out = np.zeros((ends[-1], ends[-1]))
    for i, (rows, part) in enumerate(columns):
        for k in np.flatnonzero((starts[: i + 1] < rows.stop) & (stops[: i + 1] > rows.start)).tolist():
            first, last = max(rows.start, int(starts[k])), min(rows.stop, int(stops[k]))
            here, there = part[first - rows.start : last - rows.start], columns[k][1][first - starts[k] :]
            product = here.T @ there[: last - first]
            out[ends[i] : ends[i + 1], ends[k] : ends[k + 1]] = product
            out[ends[k] : ends[k + 1], ends[i] : ends[i + 1]] = product.T
    return out
