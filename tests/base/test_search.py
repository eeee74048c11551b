"""The search on a toy problem: which of twenty columns does a linear regression have?"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.criterion import gain
from flexviz.analysis.diagnosis.search import Search
from tests.cases import slow
from tests.toy_regression import COLUMNS, FITTED, HELD_OUT, LinearModel, Regression, autoregressive

Array = NDArray[np.float64]

COUNT = FITTED + HELD_OUT
TRUE = {2: 1.0, 7: -0.6, 8: 0.4, 15: 0.8}  # columns 7 and 15 are of one place
NOISE = 0.5


def columns(rng: np.random.Generator, correlation: float = 0.0) -> Array:
    """Twenty columns of variance 1 that correlate with one another, shape (N, 20)."""
    own, common = rng.standard_normal((COUNT, COLUMNS)), rng.standard_normal((COUNT, 1))
    return np.sqrt(1 - correlation) * own + np.sqrt(correlation) * common


def target(rng: np.random.Generator, x: Array, true: dict[int, float] = TRUE) -> Array:
    """What the columns make, with noise, shape (N,)."""
    return x[:, list(true)] @ np.array(list(true.values())) + NOISE * rng.standard_normal(COUNT)


def searched(problem: Regression, start: Collection[int] = ()) -> tuple[LinearModel, Search[LinearModel]]:
    """The end of a search from some columns, and the search with its trace."""
    search = Search(problem)
    return search.run(search.pruned(problem.fit(start))), search


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("correlation", [0.0, 0.7])
@pytest.mark.parametrize("seed", range(8))
def test_exactly_the_true_columns_are_found(seed: int, correlation: float, known: bool) -> None:
    rng = np.random.default_rng(seed)
    x = columns(rng, correlation)
    found, _ = searched(Regression(x, target(rng, x), NOISE if known else None))
    assert found.columns == frozenset(TRUE)
    for k, value in TRUE.items():
        assert found.coefficients[k] == pytest.approx(value, abs=0.15)
    assert found.score.deviation[0] == pytest.approx(NOISE, rel=0.08)


@pytest.mark.parametrize("alike", [True, False])
def test_one_part_stands_for_two_where_these_are_no_better(alike: bool) -> None:
    rng = np.random.default_rng(21)
    x = columns(rng)
    y = target(rng, x)
    if alike:
        x[:, 0] = TRUE[2] * x[:, 2] + TRUE[7] * x[:, 7]
    found, search = searched(Regression(x, y, NOISE, merged=(0, frozenset({2, 7}))), set(TRUE))
    assert found.columns == ({0, 8, 15} if alike else set(TRUE))
    (tried,) = [t for t in search.trace if t.kind == "swap"]
    assert (tried.added, set(tried.removed), tried.accepted) == ((0,), {2, 7}, alike)


@pytest.mark.parametrize("start", [{0, 1, 3}, set(TRUE) | {4, 5}, set(range(COLUMNS))])
def test_what_a_start_has_too_much_is_dropped(start: set[int]) -> None:
    rng = np.random.default_rng(20)
    x = columns(rng, 0.3)
    found, _ = searched(Regression(x, target(rng, x), NOISE), start)
    assert found.columns == frozenset(TRUE)


@pytest.mark.parametrize("known", [True, False])
def test_a_near_twin_is_exchanged_for_the_right_column(known: bool) -> None:
    """They are never in a model together, like a law and the one that it refines."""
    rng = np.random.default_rng(30)
    x = columns(rng)
    x[:, 9] = 0.95 * x[:, 2] + np.sqrt(1 - 0.95**2) * x[:, 9]
    problem = Regression(x, target(rng, x), NOISE if known else None, twins=[(2, 9)])
    found, search = searched(problem, {9})
    assert found.columns == frozenset(TRUE)
    (swap,) = (move for move in search.trace if move.kind == "swap" and move.accepted)
    assert (swap.added, swap.removed) == ((2,), (9,))
    again, search = searched(problem, {2})  # nor is it exchanged for the other one
    assert again.columns == frozenset(TRUE)
    (refused,) = (move for move in search.trace if move.kind == "swap")
    assert not refused.accepted and refused.gain.delta < 0


@pytest.mark.parametrize("start", [frozenset[int](), frozenset({0, 1, 3})])
def test_the_accepted_moves_lead_from_the_start_to_the_end(start: frozenset[int]) -> None:
    """From the trace alone the model can be rebuilt, and its moves add up to what the whole way gains."""
    rng = np.random.default_rng(40)
    x = columns(rng, 0.3)
    problem = Regression(x, target(rng, x), NOISE)
    search = Search(problem)
    end = search.run(search.pruned(problem.fit(start)))
    have: frozenset[object] = start
    total, models = 0.0, [start]
    for move in search.trace:
        if move.accepted:
            assert set(move.removed) <= have and not have & set(move.added)
            have = (have - set(move.removed)) | set(move.added)
            models.append(have)  # type: ignore[arg-type]
            total += move.gain.delta
            assert move.gain.delta > 0 and move.resolution == "toy" and not move.gain.why
        else:
            assert move.gain.why
    assert have == end.columns
    assert total == pytest.approx(gain(problem.fit(start).score, end.score).delta, rel=1e-9)
    for before, after in pairwise(models):  # J only falls
        assert problem.fit(before).score.total > problem.fit(after).score.total


def test_no_end_is_worse_than_a_model_that_was_tried() -> None:
    rng = np.random.default_rng(41)
    x = columns(rng, 0.6)
    seen: list[float] = []

    class Watched(Regression):
        def fit(self, columns: object) -> LinearModel:
            model = super().fit(columns)  # type: ignore[arg-type]
            seen.append(model.score.total)
            return model

    end, _ = searched(Watched(x, target(rng, x), NOISE))
    assert end.score.total <= min(seen) + 1e-9


@pytest.mark.parametrize("harmed", [True, False])
def test_what_held_out_groups_need_is_not_dropped(harmed: bool) -> None:
    """A column that hardly varies in the fitted rows is cheap to leave out, and is missed in the others."""
    rng, own = np.random.default_rng(50), 3
    x = columns(rng)
    x[:FITTED, own] *= 0.3
    true = TRUE | {own: 0.18 * NOISE * harmed}
    problem = Regression(x, target(rng, x, true))
    search = Search(problem)
    larger, smaller = problem.fit(true), problem.fit(TRUE)
    found = search.gain(larger, smaller)
    assert found.delta > 0 and (found.held_out < np.log(0.05)) == harmed
    assert found.accepted == (not harmed)
    assert own in search.pruned(larger).columns if harmed else search.pruned(larger).columns == set(TRUE)
    refused = [t for t in search.trace if t.removed == (own,) and not t.accepted]
    assert [t.gain.why for t in refused] == ["held-out groups are described less well"] * harmed


def test_another_fit_of_the_same_columns_is_no_move() -> None:
    rng = np.random.default_rng(52)
    x = columns(rng)
    y = target(rng, x)
    asked: list[str] = []

    class Moved(Regression):
        @property
        def stages(self) -> Any:
            return {"add": self.moved}

        def moved(self, model: LinearModel) -> Iterator[tuple[Hashable, LinearModel]]:
            lower = replace(model.score, by_joint=model.score.by_joint - 50.0)
            other = replace(model, score=lower)
            asked.append("moved")
            assert search.gain(model, other).accepted  # J alone says so
            yield "", other

    problem = Moved(x, y, NOISE)
    search = Search(problem)
    start = problem.fit(TRUE)
    assert search.run(start) is start and search.trace == [] and asked == ["moved"]


@pytest.mark.parametrize(("known", "rho"), [(True, 0.0), (False, 0.0), slow(False, 0.6)])
def test_hardly_anything_is_found_in_noise(known: bool, rho: float) -> None:
    """In 200 sets of pure noise, ten at most (`false_alarm`); the columns are as correlated as the noise."""
    false = 0
    for seed in range(200):
        rng = np.random.default_rng(1000 + seed)
        if rho:
            x, y = autoregressive(rng, COUNT, rho, COLUMNS), autoregressive(rng, COUNT, rho)[:, 0]
        else:
            x, y = columns(rng), rng.standard_normal(COUNT)
        found, _ = searched(Regression(x, y, 1.0 if known else None))
        false += bool(found.columns)
    assert false <= 10


def test_a_small_column_is_found_more_often_the_larger_it_is() -> None:
    """√(2 · cost / N) σ, about 0.13 σ, is the limit of detection."""
    rates = []
    for size in (0.05, 0.13, 0.3):
        hits = 0
        for seed in range(30):
            rng = np.random.default_rng(seed)
            x = columns(rng)
            found, _ = searched(Regression(x, size * x[:, 3] + rng.standard_normal(COUNT)))
            hits += 3 in found.columns
        rates.append(hits / 30)
    assert rates[0] < 0.1 and rates[0] < rates[1] < rates[2] and rates[2] > 0.95


@pytest.mark.parametrize("there", [True, False])
def test_an_unknown_input_is_added_where_no_column_explains_what_is_left(there: bool) -> None:
    """And the columns that it hid are found beside it."""
    rng = np.random.default_rng(51)
    x = columns(rng)
    problem = Regression(x, target(rng, x), None, unknown=True)
    hidden = 20 * problem.waves[:, 2] - 15 * problem.waves[:, 5]
    problem.y = problem.y + there * hidden
    found, search = searched(problem)
    assert found.columns == frozenset(TRUE) | ({"unknown"} if there else frozenset())
    moves = [move for move in search.trace if move.kind == "unknown"]
    assert any(move.accepted for move in moves) == there
    if there:
        (made,) = (move for move in moves if move.accepted)
        assert "unknown" in made.added and made.gain.delta > 500
