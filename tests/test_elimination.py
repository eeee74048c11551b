"""Drops and scores in closed form, against fits of every smaller and larger model."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from flexviz.diagnosis.motion_fit import MotionContext
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from flexviz.diagnosis.candidates import with_effects
from flexviz.diagnosis.coarse import Coarse, CoarseModel
from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, gain, likelihood
from flexviz.diagnosis.elimination import Linearised, by_weight, eliminate
from flexviz.diagnosis.fine import Fine
from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.prediction_errors import Known
from flexviz.diagnosis.resolution import without
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout, layout_of
from flexviz.estimation import Bounds
from flexviz.measurements import MeasurementSet
from tests.planar_arm import HELD_OUT, planar_set
from tests.toy_regression import residuals_of

Array = NDArray[np.float64]

OFFSETS = tuple(ChosenEffect("torque_offset", j) for j in (0, 1))
COULOMB = tuple(ChosenEffect("coulomb_friction", j) for j in (0, 1))
QUADRATIC = tuple(ChosenEffect("quadratic_friction", j) for j in (0, 1))
NAMED = Layout(("a", "b"), (*OFFSETS, *COULOMB, *QUADRATIC))  # one parameter each
TRIED, COUNTS = 30, (300, 100)


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

    def solved(self, absent: Collection[ChosenEffect] = ()) -> Array:
        """Parameters (P,) of the best model without some effects, within the bounds."""
        gone = [self.layout.effect_slice(e).start for e in absent]
        free = np.setdiff1d(np.arange(self.layout.size), gone)
        root = np.sqrt(self.precision)
        weighted = (self.jacobians[0] / self.sigma[:, None]).reshape(-1, self.layout.size)
        rows = np.vstack((weighted, root))[:, free]
        right = np.append((self.targets[0] / self.sigma).ravel(), root @ self.centre)
        found = lsq_linear(
            rows, right, (self.bounds.lower[free], self.bounds.upper[free]), method="bvls", tol=1e-14
        )
        x = np.zeros(self.layout.size)
        x[free] = found.x
        return x

    def parts(self, x: Array) -> list[Residuals]:
        pairs = zip(self.jacobians, self.targets, strict=True)
        return [residuals_of(jacobian @ x - target, 20) for jacobian, target in pairs]

    def likelihood(self, x: Array, count: int, times: Array | None = None) -> Likelihood:
        """Of a model with `count` effects at x, shape (P,)."""
        away = x - self.centre
        other = 0.5 * float(away @ self.precision @ away)
        return likelihood(self.parts(x), self.sigma, other, count, np.inf, times)

    @property
    def data(self) -> Linearised:
        """The model with all effects."""
        x = self.solved()
        weighted = (self.jacobians[0] / self.sigma[:, None]).reshape(-1, self.layout.size)
        return Linearised(
            self.layout, x, self.parts(x), self.jacobians, self.sigma, weighted.T @ weighted + self.precision,
            (self.precision @ (x - self.centre), self.precision), np.zeros(self.layout.size, bool),
            self.bounds, self.likelihood(x, len(self.layout.effects)), np.inf,
        )  # fmt: skip

    def need(self, effect: ChosenEffect, absent: Collection[ChosenEffect] = ()) -> Gain:
        """What an effect gains beside all but the absent ones, from two fits."""
        count, times = len(self.layout.effects) - len(absent), self.data.likelihood.times
        larger, smaller = self.solved(absent), self.solved({*absent, effect})
        return gain(self.likelihood(smaller, count - 1, times), self.likelihood(larger, count, times), TRIED)


def same(found: Gain, expected: Gain, rel: float = 1e-6) -> None:
    assert found.delta == pytest.approx(expected.delta, rel=rel, abs=1e-6)
    assert found.error == pytest.approx(expected.error, rel=rel, abs=1e-6)
    np.testing.assert_allclose(found.by_joint, expected.by_joint, rtol=rel, atol=1e-6)
    assert found.accepted == expected.accepted


SIZES = np.array([0.8, 0.05, 0.5, 0.9, 0.0, 0.02])


@pytest.mark.parametrize("seed", range(4))
def test_what_each_effect_gains_is_what_two_fits_say(seed: int) -> None:
    problem = Linear.made(SIZES, seed)
    found = eliminate(problem.data, lambda layout: layout.effects, (), TRIED)
    assert not found.dropped and set(found.kept) == set(NAMED.effects)
    for effect, need in found.kept.items():
        same(need, problem.need(effect))
    assert [found.kept[e].accepted for e in (OFFSETS[0], COULOMB[0], COULOMB[1], QUADRATIC[0])] == [
        True
    ] * 3 + [False]


@pytest.mark.parametrize("seed", range(4))
def test_what_is_not_needed_goes_and_what_stays_is_where_a_fit_ends(seed: int) -> None:
    problem = Linear.made(SIZES, seed)
    found = eliminate(problem.data, lambda _: (), (), TRIED)
    assert set(found.kept) >= {OFFSETS[0], *COULOMB} and QUADRATIC[0] in found.dropped
    np.testing.assert_allclose(found.x, problem.solved(found.dropped), atol=1e-8)
    for effect in found.dropped:
        assert found.x[NAMED.effect_slice(effect)] == 0 and not found.dropped[effect].accepted
    for effect, need in found.kept.items():  # beside those that are left
        same(need, problem.need(effect, found.dropped))
        assert need.accepted


def test_firm_effects_stay_and_impossible_ones_go() -> None:
    problem = Linear.made(SIZES)
    found = eliminate(problem.data, lambda layout: {QUADRATIC[0]} & {*layout.effects}, [COULOMB[0]], TRIED)
    assert QUADRATIC[0] in found.kept and not found.kept[QUADRATIC[0]].accepted
    assert next(iter(found.dropped)) == COULOMB[0] and found.dropped[COULOMB[0]].accepted
    np.testing.assert_allclose(found.x, problem.solved(found.dropped), atol=1e-8)
    both = eliminate(problem.data, lambda layout: layout.effects, [COULOMB[0]], TRIED)
    assert COULOMB[0] in both.kept  # the set's own model is not judged


def test_one_of_two_effects_that_look_the_same_stays() -> None:
    """Neither is needed beside the other; without both, half of the torque is unexplained."""
    problem = Linear.made(SIZES, alike=0.999)
    assert not problem.need(OFFSETS[0]).accepted and not problem.need(COULOMB[0]).accepted
    found = eliminate(problem.data, lambda _: (), (), TRIED)
    left = {OFFSETS[0], COULOMB[0]} & set(found.kept)
    assert len(left) == 1 and COULOMB[1] in found.kept
    (effect,) = left
    assert found.x[NAMED.effect_slice(effect)] == pytest.approx(1.3, abs=0.2)
    same(found.kept[effect], problem.need(effect, found.dropped), rel=1e-5)


def test_a_parameter_that_is_held_does_not_move() -> None:
    problem = Linear.made(SIZES)
    held = np.zeros(NAMED.size, bool)
    held[3] = held[NAMED.effect_slice(OFFSETS[1])] = True
    found = eliminate(replace(problem.data, held=held), lambda _: (), [COULOMB[0]], TRIED)
    assert found.x[3] == problem.data.x[3]


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


# -- a simulated arm

HIDDEN = {COULOMB[0]: 0.3, COULOMB[1]: 0.1, OFFSETS[0]: 0.15, ChosenEffect("motor_coupling", 0): 0.01,
          QUADRATIC[1]: 0.03}  # fmt: skip
SMALL = [e for e in HIDDEN if e not in COULOMB]
PARAMETER = {"coulomb_friction": "coulomb", "torque_offset": "offset", "motor_coupling": "inertia",
             "quadratic_friction": "quadratic"}  # fmt: skip


def arm_with(folder: Path, times: float) -> MeasurementSet:
    """Friction of both joints, and smaller effects of so many times their size."""
    sizes = {e: v * (times if e in SMALL else 1.0) for e, v in HIDDEN.items()}
    texts = [f"{e.text(('joint1', 'joint2'))}:{PARAMETER[e.effect]}={v}" for e, v in sizes.items()]
    return planar_set(folder, texts, 5, groups=HELD_OUT)


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> Coarse:
    measurements = arm_with(tmp_path_factory.mktemp("arm") / "set", 1.0)
    own = layout_of(measurements)
    return Coarse(MotionContext(measurements, own.joints, stand_ins=True), own, lambda _: None)


@pytest.fixture(scope="module")
def coarse(view: Coarse) -> CoarseModel:
    """With what is hidden, and two effects that are not."""
    layout = Layout(view.own.joints, (*HIDDEN, OFFSETS[1], QUADRATIC[0]))
    return view.fit(layout, view.context.start(layout).x)


@pytest.fixture(scope="module")
def fine(tmp_path_factory: pytest.TempPathFactory) -> Fine:
    """Of an arm whose small effects hardly rise above the noise."""
    measurements = arm_with(tmp_path_factory.mktemp("quiet") / "set", 0.05)
    own = layout_of(measurements)
    return Fine(FitContext(measurements, own), own, lambda _: None)


def test_drops_in_the_band_of_the_motion_agree_with_fits(view: Coarse, coarse: CoarseModel) -> None:
    found = eliminate(view.linearised(coarse), lambda layout: layout.effects, (), view.tried).kept
    assert len(found) == 7
    for effect in found.keys() - {COULOMB[1]}:  # without it, quadratic friction would be at its bound
        need, layout = found[effect], without(coarse.layout, [effect])
        smaller = view.fit(layout, layout.vector(coarse.layout.model(coarse.fit.x)))
        refitted = gain(smaller.likelihood, coarse.likelihood, view.tried)
        # where much is missing, what is left weights the joints otherwise
        rel = 0.1 if effect == COULOMB[0] else 0.05
        assert need.delta == pytest.approx(refitted.delta, rel=rel, abs=0.2), effect
        assert need.error == pytest.approx(refitted.error, rel=0.15, abs=0.2), effect
        assert need.accepted == refitted.accepted


def test_what_is_left_after_drops_is_what_is_hidden_and_still_shows(
    view: Coarse, coarse: CoarseModel
) -> None:
    pruned = view.pruned(coarse)
    assert set(pruned.layout.effects) == set(HIDDEN)
    for effect, where in pruned.layout.effect_slices():
        assert pruned.fit.x[where][0] == pytest.approx(HIDDEN[effect], rel=0.05)


def test_scores_in_the_band_of_the_motion_agree_with_fits(view: Coarse, coarse: CoarseModel) -> None:
    for effect in SMALL:
        layout = without(coarse.layout, [effect])
        fit = view.fit(layout, layout.vector(coarse.layout.model(coarse.fit.x))).fit
        (score,) = view.scores(fit, [effect], episodes=False)
        start = with_effects(fit, {effect: score.values})
        larger = view.fit(start.layout, start.x).fit
        assert score.gain == pytest.approx(fit.objective - larger.objective, rel=0.1), effect
        assert score.values == pytest.approx(larger.x[larger.layout.effect_slice(effect)], rel=0.02)


def test_drops_and_scores_near_the_noise_agree_with_fits(fine: Fine) -> None:
    layout = Layout(fine.own.joints, tuple(HIDDEN))
    whole = fine.fit(layout, fine.context.start(layout).x)
    drops = eliminate(fine.linearised(whole), lambda layout: layout.effects, (), fine.tried).kept
    for effect in SMALL:
        smaller = without(layout, [effect])
        base = fine.fit(smaller, smaller.vector(layout.model(whole.fit.x)), near=whole.fit)
        refitted = gain(base.likelihood, whole.likelihood, fine.tried)
        assert drops[effect].delta == pytest.approx(refitted.delta, rel=0.05, abs=1.0), effect
        assert drops[effect].error == pytest.approx(refitted.error, rel=0.15), effect
        (score,) = fine.scores(base.fit, [effect], episodes=False)
        start = with_effects(Known(smaller, base.fit.x), {effect: score.values})
        larger = fine.fit(start.layout, start.x, near=base.fit).fit
        decrease = np.sum(base.fit.point.r**2) - np.sum(larger.point.r**2)
        assert score.gain == pytest.approx(decrease, rel=0.1, abs=0.5), effect
        assert score.values == pytest.approx(larger.x[larger.layout.effect_slice(effect)], rel=0.02)
