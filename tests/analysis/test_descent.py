"""The loop of all fits on toy problems."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.estimation import Bounds, Descent, NormalEquations, Reach
from flexviz.analysis.estimation import descent as loop


@dataclass(frozen=True, eq=False)
class Toy:
    """A place: x and half the sum of squares there."""

    x: np.ndarray
    objective: float


class Rosenbrock:
    """½ (100 (x₂ − x₁²)² + (1 − x₁)²), of which whole Gauss–Newton steps go far uphill."""

    def __init__(self) -> None:
        self.evaluated = 0

    def residual(self, x: np.ndarray) -> np.ndarray:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

    def at(self, x: np.ndarray, before: Toy | None = None) -> Toy:
        self.evaluated += 1
        return Toy(x, 0.5 * float(self.residual(x) @ self.residual(x)))

    def lower(self, x: np.ndarray, before: Toy) -> Toy | None:
        there = self.at(x)
        return there if there.objective < before.objective else None

    def normal_equations(self, place: Toy) -> NormalEquations:
        jacobian = np.array([[-20 * place.x[0], 10.0], [-1.0, 0.0]])
        return NormalEquations(jacobian.T @ self.residual(place.x), jacobian.T @ jacobian, np.zeros((2, 2)))


OPEN = Reach(Bounds(np.full(2, -np.inf), np.full(2, np.inf)))
START = np.array([-1.2, 1.0])


def descent(reach: Reach = OPEN, start: np.ndarray = START, **options: Any) -> Descent[Toy]:
    problem = Rosenbrock()
    return Descent(problem, reach, problem.at(start), negligible=1e-6, **options)


def test_halved_steps_only_lead_down() -> None:
    objectives: list[float] = []
    found = descent(damped=True, watch=lambda now: objectives.append(now.place.objective))
    found.run(50)
    assert found.converged and not found.stuck and found.best is found.place
    np.testing.assert_allclose(found.place.x, [1.0, 1.0], atol=1e-6)
    assert np.all(np.diff(objectives) < 0) and len(objectives) == found.steps + 1


def test_whole_steps_may_lead_up_and_the_best_place_is_kept() -> None:
    found = descent()
    found.run(1)
    assert found.steps == 1 and not found.converged
    assert found.place.objective > 50 * found.best.objective and found.best.x is START
    found.run(5)  # goes on from there
    assert found.converged
    np.testing.assert_allclose(found.place.x, [1.0, 1.0], atol=1e-6)


def test_a_bound_is_held() -> None:
    reach = Reach(Bounds(np.full(2, -np.inf), np.array([0.5, np.inf])))
    found = descent(reach, np.zeros(2), damped=True)
    found.run(50)
    assert found.converged and list(found.at_bound) == [True, False]
    np.testing.assert_allclose(found.place.x, [0.5, 0.25], atol=1e-6)


def test_one_step_changes_a_compliance_by_a_factor_at_most() -> None:
    reach = Reach(OPEN.bounds, compliance=slice(1, 2), factors=(0.2, 5.0))
    longest = next(reach.along(np.ones(2), np.array([9.0, 9.0]), 1))
    least = next(reach.along(np.ones(2), np.array([-9.0, -9.0]), 1))
    assert list(longest) == [10.0, 5.0] and list(least) == [-8.0, 0.2]


def test_steps_stay_where_it_is_feasible() -> None:
    reach = Reach(OPEN.bounds, feasible=lambda x: bool(x[0] < 0.7))
    assert [float(x[0]) for x in reach.along(np.zeros(2), np.ones(2), 3)] == [0.5, 0.25]
    found = descent(reach, np.zeros(2))
    found.run(100)
    assert 0.6 < found.place.x[0] < 0.7


def test_nothing_lower_ends_a_descent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "HALVINGS", 1)  # only whole steps, and the first one leads up
    found = descent(damped=True)
    found.run(50)
    assert found.stuck and not found.converged and found.place.x is START
    assert found.length > 1.0


def test_a_settled_objective_ends_a_descent() -> None:
    whole, settled = descent(damped=True), descent(damped=True, settled=0.5)
    whole.run(50)
    settled.run(50)
    assert settled.converged and settled.steps < whole.steps and abs(settled.gained) < 0.5
    near = descent(start=np.array([1.0, 1.0 + 1e-3]), settled=0.5)  # a step promises 1e-4
    near.run(50)
    assert near.converged and near.steps == 0 and near.length**2 < 0.5
    started = descent(start=np.ones(2))
    started.run(50)
    assert started.converged and started.steps == 0


def test_a_watch_ends_or_stops_a_descent_that_keeps_its_place() -> None:
    ended = descent(damped=True, watch=lambda now: now.steps == 3)
    ended.run(50)
    assert ended.ended and ended.steps == 3 and not ended.converged

    def stop(now: Descent[Toy]) -> None:
        if now.steps == 3:
            raise KeyboardInterrupt

    stopped = descent(damped=True, watch=stop)
    with pytest.raises(KeyboardInterrupt):
        stopped.run(50)
    np.testing.assert_array_equal(stopped.place.x, ended.place.x)
    assert stopped.came == ended.came < np.inf
