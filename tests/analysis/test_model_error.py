"""Intervals with what a model lacks: closed forms, and torques drawn at random."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from flexviz.analysis.estimation import Covariance, model_error
from flexviz.analysis.estimation.model_error import with_model_error
from flexviz.analysis.estimation.score_test import Projection
from flexviz.base.arrays import Array
from flexviz.base.statistics import NORMAL_95
from flexviz.model.effects import ChosenEffect

JOINTS = 2
SAMPLES = 40  # rows: sample by sample, the joints within
Library = Sequence[tuple[int | None, Array]]  # an effect's joint and its signatures, (M, guesses)
Widened = Callable[[Library, Array, Array, Array], Array]


@pytest.fixture
def widened(monkeypatch: pytest.MonkeyPatch) -> Widened:
    """Variances (P,) of a linear fit: by library, Jacobian, excess of the joints and variances of chance."""

    def of(library: Library, jacobian: Array, excess: Array, chance: Array) -> Array:
        def guesses(*_: Any) -> Iterator[tuple[ChosenEffect, Array]]:
            for k, (joint, columns) in enumerate(library):
                for column in columns.T:
                    yield ChosenEffect(f"effect {k}", joint), column[:, None]

        fit: Any = SimpleNamespace(
            point=SimpleNamespace(signals=SimpleNamespace(count=SAMPLES)),
            chain=None,
            weigh=None,
            lacking=(),
            at_bound=np.zeros(jacobian.shape[1], bool),
            projection=Projection(np.zeros(len(jacobian)), jacobian, jacobian.T @ jacobian),
        )
        monkeypatch.setattr(model_error, "weighted_guesses", guesses)
        (found,) = with_model_error([Covariance(np.diag(chance), np.zeros(len(chance)))], [fit], excess)
        return np.diag(found.matrix)

    return of


def test_moves_by_effects_of_the_size_that_the_residual_shows(widened: Widened) -> None:
    """Signatures h = cos φ z + sin φ b, b no parameter's: each moves one parameter by cos φ / |z|."""
    unit = np.eye(SAMPLES * JOINTS)
    jacobian = unit[:, :3] * (2.0, 5.0, 0.5)
    rest = iter(unit[:, 3:].T)

    def effect(parameter: int, *angles: float) -> Array:
        parts = [np.cos(a) * unit[:, parameter] + np.sin(a) * next(rest) for a in angles]
        return np.stack(parts, axis=1) * 7.0  # whatever the unit of their coefficient

    angles: dict[int, list[tuple[float, ...]]] = {
        0: [(0.3, 0.9), (0.5,)],
        1: [(0.2, 0.4, 1.0, 1.2)],
        2: [(0.6, 0.8)],
    }
    library = [(None if k == 2 else k, effect(k, *a)) for k, of in angles.items() for a in of]
    excess, chance = np.array([0.04, 0.3]), np.array([1e-3, 2e-3, 0.1])
    found = widened(library, jacobian, excess, chance)

    size = [SAMPLES * e / sum(np.mean(np.sin(a) ** 2) for a in angles[j]) for j, e in enumerate(excess)]
    size.append(sum(size) / 2)  # without a joint: as large as those of the joints on average
    for k, scale in enumerate((2.0, 5.0, 0.5)):
        parts = np.array([size[k] * np.mean(np.cos(a) ** 2) / scale**2 for a in angles[k]])
        total = chance[k] + parts.sum()
        freedom = total**2 / np.sum(parts**2)
        assert found[k] == pytest.approx(total * (student.ppf(0.975, freedom) / 1.96) ** 2, rel=1e-6)


def test_intervals_hold_the_truth_as_often_as_they_say_and_are_no_wider(widened: Widened) -> None:
    """Parameters fitted to torques that the model lacks: few effects of the library, their sizes unknown."""
    rng = np.random.default_rng(0)
    parameters, own, common = 4, 12, 2
    rows = np.arange(SAMPLES * JOINTS) % JOINTS
    jacobian = rng.standard_normal((len(rows), parameters))

    def signatures(joint: int | None) -> Array:
        like = jacobian @ rng.standard_normal((parameters, 1))
        columns = like / np.linalg.norm(like) + 0.8 * rng.standard_normal((len(rows), 3)) / np.sqrt(len(rows))
        columns[(rows != joint) & (joint is not None)] = 0.0
        return columns / np.linalg.norm(columns, axis=0)

    places = [*np.repeat(np.arange(JOINTS), own).tolist(), *[None] * common]
    library = [(place, signatures(place)) for place in places]
    chance = 1e-8 * np.diag(np.linalg.inv(jacobian.T @ jacobian)).astype(float)
    inside, ratio = [], []
    for _ in range(200):
        missing = [rng.normal(0, 0.3) * columns[:, rng.integers(3)] for _, columns in library]
        residual = np.sum(missing, axis=0) + 1e-4 * rng.standard_normal(len(rows))
        error = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        left = (residual - jacobian @ error).reshape(SAMPLES, JOINTS)
        excess = np.array([np.mean(column**2) for column in left.T])
        std = np.sqrt(widened(library, jacobian, excess.astype(float), chance))
        inside.append(np.abs(error) < NORMAL_95 * std)
        ratio.append(error / std)
    assert 0.93 < np.mean(inside) < 0.98
    assert 0.7 < np.std(ratio) < 1.1
