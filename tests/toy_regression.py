"""A linear regression as a problem of the search: every fit and score in closed form."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.criterion import Score, criterion_of
from flexviz.analysis.motion import Residuals

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

COLUMNS = 20
FITTED, HELD_OUT, BLOCK = 900, 300, 300  # samples
WAVES = 8  # columns of an unknown input


def autoregressive(rng: np.random.Generator, count: int, rho: float, n: int = 1) -> Array:
    """Noise of variance 1 whose samples correlate by ρ^k over k steps, shape (count, n)."""
    noise = rng.standard_normal((count, n))
    for k in range(1, count):
        noise[k] = rho * noise[k - 1] + np.sqrt(1 - rho**2) * noise[k]
    return noise


def residuals_of(values: Array, used: Bools | None = None, block: int | None = None) -> Residuals:
    """Residuals (N, n) of one part, in equal blocks."""
    count = len(values)
    used = np.ones(values.shape, bool) if used is None else used
    length = block or count
    return Residuals(values, used, [slice(k, min(k + length, count)) for k in range(0, count, length)])


@dataclass(frozen=True)
class LinearModel:
    """Columns with their coefficients, and the score."""

    columns: frozenset[int | str]
    coefficients: dict[int | str, float]
    score: Score


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
        self.twins = {a: b for pair in twins for a, b in (pair, pair[::-1])}
        time = np.arange(len(y))[:, None] / len(y)
        self.waves = np.cos(np.pi * time * np.arange(1, WAVES + 1))
        least = np.array([1e-6 if noise is None else 1.05 * noise])
        self.criterion = criterion_of(self.left(())[0], least, COLUMNS)

    def matrix(self, columns: Iterable[int | str]) -> tuple[Array, list[int | str]]:
        """Columns of a model, shape (N, P), with their names."""
        names = sorted(columns, key=str)
        parts = [self.waves if name == "unknown" else self.x[:, [int(name)]] for name in names]
        return np.hstack(parts) if parts else np.zeros((len(self.y), 0)), names

    def left(self, columns: Iterable[int | str]) -> tuple[list[Residuals], Array]:
        """What least squares on the fitted rows leave, and the coefficients."""
        matrix, _ = self.matrix(columns)
        solved = np.linalg.lstsq(matrix[:FITTED], self.y[:FITTED], rcond=None)
        found = np.asarray(solved[0], np.float64)
        left = (self.y - matrix @ found)[:, None]
        return [residuals_of(rows, block=BLOCK) for rows in (left[:FITTED], left[FITTED:])], found

    def fit(self, columns: Iterable[int | str]) -> LinearModel:
        """A model with its score."""
        parts, found = self.left(columns)
        names = self.matrix(columns)[1]
        single = [name for name in names if name != "unknown"]
        cost = self.criterion.cost(len(found), len(names))
        score = self.criterion.score(parts, cost)
        return LinearModel(frozenset(names), dict(zip(single, found, strict=False)), score)

    # -- the problem

    @property
    def stages(self) -> dict[str, Callable[[LinearModel], Iterable[tuple[Hashable, LinearModel]]]]:
        return {"add": self.larger, "swap": self.rivals, "unknown": self.unknowns}

    def parts(self, model: LinearModel) -> frozenset[int | str]:
        return model.columns

    def score(self, model: LinearModel) -> Score:
        return model.score

    def larger(self, model: LinearModel) -> Iterator[tuple[Hashable, LinearModel]]:
        """Every further column; four places."""
        for k in range(COLUMNS):
            if k not in model.columns and self.twins.get(k) not in model.columns:
                yield k % 4, self.fit({*model.columns, k})

    def united(self, model: LinearModel, others: list[LinearModel]) -> LinearModel:
        gone = {k for other in others for k in model.columns - other.columns}
        return self.fit((model.columns - gone).union(*(other.columns - model.columns for other in others)))

    def smaller(self, model: LinearModel) -> list[LinearModel]:
        """Without a column, the least needed first."""
        smaller = [self.fit(model.columns - {k}) for k in model.columns if k != "unknown"]
        return sorted(smaller, key=lambda one: one.score.total)

    def rivals(self, model: LinearModel) -> Iterator[tuple[Hashable, LinearModel]]:
        for k in model.columns:
            if k in self.twins:
                yield k, self.fit((model.columns - {k}) | {self.twins[int(k)]})
        if self.merged is not None and self.merged[1] <= model.columns:
            whole, some = self.merged
            yield whole, self.fit((model.columns - some) | {whole})

    def unknowns(self, model: LinearModel) -> Iterator[tuple[Hashable, LinearModel]]:
        if self.unknown and "unknown" not in model.columns:
            yield "unknown", self.fit(model.columns | {"unknown"})
