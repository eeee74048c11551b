"""A linear regression as a problem of the search: every fit and score in closed form."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, gain, likelihood
from flexviz.diagnosis.search import Candidate

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

COLUMNS = 20
FITTED, HELD_OUT, BLOCK, STRETCH = 900, 300, 300, 25  # samples
WAVES = 8  # columns of an unknown input


def autoregressive(rng: np.random.Generator, count: int, rho: float, n: int = 1) -> Array:
    """Noise of variance 1 whose samples correlate by ρ^k over k steps, shape (count, n)."""
    noise = rng.standard_normal((count, n))
    for k in range(1, count):
        noise[k] = rho * noise[k - 1] + np.sqrt(1 - rho**2) * noise[k]
    return noise


def residuals_of(
    values: Array, stretch: int, used: Bools | None = None, block: int | None = None
) -> Residuals:
    """Residuals (N, n) of one part, in equal stretches and blocks."""
    count = len(values)
    used = np.ones(values.shape, bool) if used is None else used

    def cut(length: int) -> list[slice]:
        return [slice(k, min(k + length, count)) for k in range(0, count, length)]

    return Residuals(values, used, cut(stretch), cut(block or count))


@dataclass(frozen=True)
class LinearModel:
    """Columns with their coefficients, and the likelihood."""

    columns: frozenset[int | str]
    coefficients: dict[int | str, float]
    likelihood: Likelihood


class Regression:
    """y = X b + noise of a joint; which columns does it have?

    Args:
        x: shape (N, 20); the last rows are held out.
        y: shape (N,).
        noise: standard deviation of the noise if it is known.
        twins: columns that are never in a model together; only an exchange tells which is right.
        merged: a column that may stand for some others together.
        unknown: whether an unknown input may be added: slow waves.
    """

    name = "toy"

    def __init__(
        self,
        x: Array,
        y: Array,
        noise: float | None = None,
        twins: Sequence[tuple[int, int]] = (),
        unknown: bool = False,
        merged: tuple[int, frozenset[int]] | None = None,
    ) -> None:
        self.x, self.y, self.unknown, self.merged = x, y, unknown, merged
        self.floor = np.array([1e-6 if noise is None else 1.05 * noise])
        self.twins = {a: b for pair in twins for a, b in (pair, pair[::-1])}
        time = np.arange(len(y))[:, None] / len(y)
        phase = np.pi * time * np.arange(1, WAVES + 1)
        self.waves = np.cos(phase)

    def matrix(self, columns: Iterable[int | str]) -> tuple[Array, list[int | str]]:
        """Columns of a model, shape (N, P), with their names."""
        names = sorted(columns, key=str)
        parts = [self.waves if name == "unknown" else self.x[:, [int(name)]] for name in names]
        return np.hstack(parts) if parts else np.zeros((len(self.y), 0)), names

    def fit(self, columns: Iterable[int | str]) -> LinearModel:
        """Least squares on the fitted rows."""
        matrix, names = self.matrix(columns)
        found = np.linalg.lstsq(matrix[:FITTED], self.y[:FITTED], rcond=None)[0]
        left = (self.y - matrix @ found)[:, None]
        parts = [residuals_of(rows, STRETCH, block=BLOCK) for rows in (left[:FITTED], left[FITTED:])]
        like = likelihood(parts, self.floor, 0.0, matrix.shape[1])
        single = [name for name in names if name != "unknown"]
        return LinearModel(frozenset(names), dict(zip(single, found, strict=False)), like)

    # -- the problem

    def parts(self, model: LinearModel) -> frozenset[int | str]:
        return model.columns

    def candidates(self, model: LinearModel) -> list[Candidate]:
        """Scores: half the decrease of χ² in closed form."""
        like, (matrix, _) = model.likelihood, self.matrix(model.columns)
        left = self.y - matrix @ np.linalg.lstsq(matrix[:FITTED], self.y[:FITTED], rcond=None)[0]
        basis = np.linalg.qr(matrix[:FITTED])[0]
        out = []
        free = [
            k for k in range(COLUMNS) if k not in model.columns and self.twins.get(k) not in model.columns
        ]
        for k in free:
            column = self.x[:FITTED, k] - basis @ (basis.T @ self.x[:FITTED, k])
            nats = 0.5 * (column @ left[:FITTED]) ** 2 / (column @ column) / like.deviation[0] ** 2
            cost = 2 * np.log(len(free)) + 0.5 * np.log(like.samples)
            out.append(Candidate(k, k % 4, 3 * float(nats / like.times[0]) - cost))
        return out

    def with_added(self, model: LinearModel, chosen: Sequence[Candidate]) -> LinearModel:
        return self.fit({*model.columns, *(int(str(c.key)) for c in chosen)})

    def promising(self, before: LinearModel, after: LinearModel) -> bool:
        return bool(gain(before.likelihood, after.likelihood).by_joint.sum() > 2 * np.log(COLUMNS))

    def pruned(self, model: LinearModel) -> LinearModel:
        """Without the columns that are not needed, the least needed first."""
        while True:
            smaller = [self.fit(model.columns - {k}) for k in model.columns if k != "unknown"]
            found = [(self.gain(one, model, COLUMNS), one) for one in smaller]
            weak = [(need.delta, k) for k, (need, _) in enumerate(found) if not need.accepted]
            if not weak:
                return model
            model = found[min(weak)[1]][1]

    def mergers(self, model: LinearModel) -> Iterable[Callable[[LinearModel], LinearModel]]:
        if self.merged is None or not self.merged[1] <= model.columns:
            return []
        whole, some = self.merged
        return [lambda other: self.fit((other.columns - some) | {whole})]

    def swaps(self, model: LinearModel) -> Iterable[Callable[[LinearModel], LinearModel]]:
        def swapped(other: LinearModel, old: int | str, new: int) -> LinearModel:
            return self.fit((other.columns - {old}) | {new})

        return [partial(swapped, old=k, new=self.twins[int(k)]) for k in model.columns if k in self.twins]

    def unknowns(self, model: LinearModel) -> Iterable[Callable[[LinearModel], LinearModel]]:
        if not self.unknown or "unknown" in model.columns:
            return []
        return [lambda other: self.fit(other.columns | {"unknown"})]

    def gain(self, before: LinearModel, after: LinearModel, tried: int) -> Gain:
        return gain(before.likelihood, after.likelihood, tried)
