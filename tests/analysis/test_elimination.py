"""Drops in closed form, against fits of every smaller model of a linear problem."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from flexviz.analysis.diagnosis.candidates import without
from flexviz.analysis.diagnosis.criterion import Criterion, Gain, Score, criterion_of, gain
from flexviz.analysis.diagnosis.elimination import Linearised, by_weight, eliminated, needs
from flexviz.analysis.estimation import Bounds
from flexviz.analysis.motion import Residuals
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout
from tests.toy_regression import residuals_of

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

OFFSETS = tuple(ChosenEffect("torque_offset", j) for j in (0, 1))
COULOMB = tuple(ChosenEffect("coulomb_friction", j) for j in (0, 1))
QUADRATIC = tuple(ChosenEffect("quadratic_friction", j) for j in (0, 1))
NAMED = Layout(("a", "b"), (*OFFSETS, *COULOMB, *QUADRATIC))  # one parameter each
CHOICES, COUNTS, BLOCK = 30, (300, 100), 100


@dataclass(frozen=True)
class Linear:
    """y = J x + noise of two joints, with a normal prior of x; the effects' parameters are the last ones."""

    layout: Layout
    jacobians: tuple[Array, Array]
    targets: tuple[Array, Array]
    centre: Array
    precision: Array
    sigma: Array
    bounds: Bounds

    @staticmethod
    def made(
        sizes: Array, seed: int = 0, alike: float = 0.0, upper: dict[int, float] | None = None
    ) -> Linear:
        """With true sizes of the effects, shape (6,), whose columns correlate with those of the robot.

        `upper`: bounds of other parameters.
        """
        rng = np.random.default_rng(seed)
        total, first = NAMED.size, NAMED.effect_start
        truth, sigma = np.append(0.3 * rng.standard_normal(first), sizes), np.array([1.0, 0.2])
        scale = sigma[None, :, None]
        jacobians, targets = [], []
        for count in COUNTS:
            jacobian = scale * rng.standard_normal((count, 2, total))
            jacobian[:, :, first:] += 0.6 * jacobian[:, :, : total - first]
            for j in (0, 1):  # an effect acts on its joint alone
                jacobian[:, 1 - j, first + j :: 2] = 0.0
            jacobian[:, :, first + 2] += alike * (jacobian[:, :, first] - jacobian[:, :, first + 2])
            jacobians.append(jacobian)
            targets.append(jacobian @ truth + sigma * rng.standard_normal((count, 2)))
        precision = np.diag(np.where(np.arange(total) < first, 4.0, 0.0))
        bounds = Bounds(np.full(total, -np.inf), np.full(total, np.inf))
        for k, value in (upper or {}).items():
            bounds.upper[k] = value
        centre = np.append(truth[:first], np.zeros(6))
        a, b = jacobians
        return Linear(NAMED, (a, b), (targets[0], targets[1]), centre, precision, sigma, bounds)

    def solved(self, absent: Collection[ChosenEffect] = (), still: Bools | None = None) -> Array:
        """Parameters (P,) of the best model without some effects, within the bounds.

        `still`: parameters, shape (P,), that stay where they are with all effects.
        """
        gone = [self.layout.effect_slice(e).start for e in absent]
        still = np.zeros(self.layout.size, bool) if still is None else still
        x = self.solved() if still.any() else np.zeros(self.layout.size)
        x[gone] = 0.0
        free = np.setdiff1d(np.flatnonzero(~still), gone)
        x[free] = 0.0
        root = np.sqrt(self.precision)
        weighted = (self.jacobians[0] / self.sigma[:, None]).reshape(-1, self.layout.size)
        rows = np.vstack((weighted, root))
        right = np.append((self.targets[0] / self.sigma).ravel(), root @ self.centre) - rows @ x
        limits = self.bounds.lower[free], self.bounds.upper[free]
        x[free] = lsq_linear(rows[:, free], right, limits, method="bvls", tol=1e-14).x
        return x

    def parts(self, x: Array) -> list[Residuals]:
        pairs = zip(self.jacobians, self.targets, strict=True)
        return [residuals_of(jacobian @ x - target, block=BLOCK) for jacobian, target in pairs]

    # -- what judges it

    @property
    def criterion(self) -> Criterion:
        return criterion_of(self.parts(self.solved()), 0.9 * self.sigma, CHOICES)

    def cost(self, layout: Layout) -> float:
        """Of effects, and more the more there are: not what they cost one by one."""
        count = len(layout.effects)
        return self.criterion.cost(count, count) + 0.1 * count**2

    def saved(self, layout: Layout, effect: ChosenEffect) -> float:
        return self.cost(layout) - self.cost(without(layout, [effect]))

    def score(self, absent: Collection[ChosenEffect] = (), still: Bools | None = None) -> Score:
        """Of the fit without some effects."""
        parts = self.parts(self.solved(absent, still))
        return self.criterion.score(parts, self.cost(without(self.layout, absent)))

    @property
    def data(self) -> Linearised:
        """The model with all effects."""
        x = self.solved()
        weighted = (self.jacobians[0] / self.sigma[:, None]).reshape(-1, self.layout.size)
        return Linearised(
            self.layout, x, self.parts(x), self.jacobians, weighted.T @ weighted + self.precision,
            (self.precision @ (x - self.centre), self.precision), np.zeros(self.layout.size, bool),
            self.bounds,
        )  # fmt: skip

    def need(self, effect: ChosenEffect) -> Gain:
        """What an effect gains given all others, from two fits."""
        return gain(self.score([effect]), self.score())

    def dropped(self, among: Collection[ChosenEffect]) -> list[ChosenEffect]:
        """The effects that go one by one, each the one without which J is lowest, from fits of all models."""
        gone: list[ChosenEffect] = []
        while left := [e for e in among if e not in gone]:
            totals = {e: self.score([*gone, e]).total for e in left}
            best = min(left, key=lambda e: totals[e])
            if totals[best] > self.score(gone).total:
                break
            gone.append(best)
        return gone


def same(found: Gain, expected: Gain) -> None:
    assert found.delta == pytest.approx(expected.delta, rel=1e-6, abs=1e-6)
    assert found.held_out == pytest.approx(expected.held_out, rel=1e-6, abs=1e-6)
    np.testing.assert_allclose(found.by_joint, expected.by_joint, rtol=1e-6, atol=1e-6)
    assert found.accepted == expected.accepted


SIZES = np.array([0.8, 0.05, 0.5, 0.9, 0.0, 0.02])


@pytest.mark.parametrize("seed", range(4))
def test_what_each_effect_gains_is_what_two_fits_say(seed: int) -> None:
    problem = Linear.made(SIZES, seed)
    found = needs(problem.data, problem.score(), problem)
    assert set(found) == set(NAMED.effects)
    for effect, (need, x) in found.items():
        same(need, problem.need(effect))
        np.testing.assert_allclose(x, problem.solved([effect]), atol=1e-8)
        assert x[NAMED.effect_slice(effect)] == 0
    needed = [found[e][0].accepted for e in (OFFSETS[0], COULOMB[0], COULOMB[1], QUADRATIC[0])]
    assert needed == [True] * 3 + [False]


def test_only_the_effects_in_question_are_judged() -> None:
    problem = Linear.made(SIZES)
    some = needs(problem.data, problem.score(), problem, [COULOMB[0], QUADRATIC[1]])
    assert set(some) == {COULOMB[0], QUADRATIC[1]}
    same(some[COULOMB[0]][0], problem.need(COULOMB[0]))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_not_needed_goes_and_what_stays_is_where_a_fit_ends(seed: int) -> None:
    problem = Linear.made(SIZES, seed)
    gone, x = eliminated(problem.data, problem.score(), problem, NAMED.effects)
    assert gone == problem.dropped(NAMED.effects)
    assert QUADRATIC[0] in gone and not {OFFSETS[0], *COULOMB} & set(gone)
    np.testing.assert_allclose(x, problem.solved(gone), atol=1e-8)
    assert all(x[NAMED.effect_slice(effect)] == 0 for effect in gone)


@pytest.mark.parametrize("among", [(), (COULOMB[0],), (OFFSETS[1], QUADRATIC[0])])
def test_only_some_effects_may_go(among: tuple[ChosenEffect, ...]) -> None:
    problem = Linear.made(SIZES)
    gone, x = eliminated(problem.data, problem.score(), problem, among)
    assert gone == problem.dropped(among) and (COULOMB[0] not in gone)
    np.testing.assert_allclose(x, problem.solved(gone), atol=1e-8)


def test_one_of_two_effects_that_look_the_same_stays() -> None:
    """Neither is needed beside the other; without both, half of the torque is unexplained."""
    problem = Linear.made(SIZES, alike=0.999)
    found = needs(problem.data, problem.score(), problem)
    assert not found[OFFSETS[0]][0].accepted and not found[COULOMB[0]][0].accepted
    same(found[OFFSETS[0]][0], problem.need(OFFSETS[0]))
    gone, x = eliminated(problem.data, problem.score(), problem, NAMED.effects)
    (effect,) = {OFFSETS[0], COULOMB[0]} - set(gone)
    assert COULOMB[1] not in gone
    assert x[NAMED.effect_slice(effect)] == pytest.approx(1.3, abs=0.2)


def test_a_parameter_that_is_held_does_not_move() -> None:
    problem = Linear.made(SIZES)
    held = np.zeros(NAMED.size, bool)
    held[3] = held[NAMED.effect_slice(QUADRATIC[1])] = True
    data = replace(problem.data, held=held)
    for effect, (need, x) in needs(data, problem.score(), problem).items():
        np.testing.assert_allclose(x[3], data.x[3], atol=0)
        if effect == QUADRATIC[1]:  # it goes, and nothing stands in for it
            np.testing.assert_allclose(np.delete(x - data.x, NAMED.effect_slice(effect)), 0.0, atol=1e-12)
        else:
            np.testing.assert_allclose(x, problem.solved([effect], held), atol=1e-8)
            same(need, gain(problem.score([effect], held), problem.score()))
    gone, x = eliminated(data, problem.score(), problem, [OFFSETS[1], QUADRATIC[0]])
    np.testing.assert_allclose(x, problem.solved(gone, held), atol=1e-8)


def test_no_parameter_leaves_its_bounds() -> None:
    """What would stand in for an effect stays at its bound, and all others move again."""
    free = Linear.made(SIZES)
    step = free.solved([COULOMB[1]]) - free.data.x
    k = int(np.argmax(np.where(np.arange(len(step)) < free.layout.effect_start, step, 0)))
    limit = float(free.data.x[k] + 0.3 * step[k])
    problem = Linear.made(SIZES, upper={k: limit})
    need, x = needs(problem.data, problem.score(), problem)[COULOMB[1]]
    assert x[k] == pytest.approx(limit) == problem.solved([COULOMB[1]])[k]
    np.testing.assert_allclose(x, problem.solved([COULOMB[1]]), atol=1e-8)
    same(need, problem.need(COULOMB[1]))


@pytest.mark.parametrize("seed", range(3))
def test_the_weightiest_effect_comes_first(seed: int) -> None:
    """Of those that are left, the one that lowers the held-out error most beside those before it."""
    problem, spread = Linear.made(SIZES, seed), np.array([3.0, 1.0])
    order = by_weight(problem.data, NAMED.effects, spread)
    assert {effect for effect, _ in order} == set(NAMED.effects)

    def misfit(present: Collection[ChosenEffect]) -> float:
        x = problem.solved([e for e in NAMED.effects if e not in present])
        return float(np.sum(np.mean(problem.parts(x)[-1].values ** 2, axis=0) / spread**2))

    before: list[ChosenEffect] = []
    for effect, start in order:
        left = [e for e in NAMED.effects if e not in before]
        np.testing.assert_allclose(start, problem.solved(left), atol=1e-8)
        assert effect == min(left, key=lambda e: misfit([*before, e]))
        before.append(effect)
    named = by_weight(problem.data, [COULOMB[0], QUADRATIC[0]], spread)
    assert [effect for effect, _ in named] == [COULOMB[0], QUADRATIC[0]]  # beside all that are not named
