"""Drops and scores of a simulated arm in closed form, against fits of every smaller and larger model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis.candidates import with_effects, without
from flexviz.analysis.diagnosis.coarse import Coarse, CoarseModel
from flexviz.analysis.diagnosis.criterion import gain
from flexviz.analysis.diagnosis.elimination import needs
from flexviz.analysis.diagnosis.fine import Fine, FineModel
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.diagnosis.search import Search
from flexviz.analysis.motion import MotionContext
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout, layout_of
from tests.planar_arm import HELD_OUT, planar_set

OFFSETS = tuple(ChosenEffect("torque_offset", j) for j in (0, 1))
COULOMB = tuple(ChosenEffect("coulomb_friction", j) for j in (0, 1))
QUADRATIC = tuple(ChosenEffect("quadratic_friction", j) for j in (0, 1))
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


@pytest.fixture
def exact(view: Coarse, monkeypatch: pytest.MonkeyPatch) -> Coarse:
    """The same without a tolerance, below which the smaller effects are."""
    least = 0.5 * view.context.noise_floor
    exact = replace(view.criterion, least=least)
    monkeypatch.setattr(view, "_criterion", exact)
    monkeypatch.setattr(view.context, "least", least)
    return view


@pytest.fixture
def coarse(exact: Coarse) -> CoarseModel:
    """With what is hidden, and two effects that are not."""
    return whole_model(exact)


def whole_model(view: Coarse) -> CoarseModel:
    layout = Layout(view.own.joints, (*HIDDEN, OFFSETS[1], QUADRATIC[0]))
    return view.fit(layout, view.context.start(layout).x)


@pytest.fixture(scope="module")
def fine(tmp_path_factory: pytest.TempPathFactory) -> Fine:
    """Of an arm whose small effects hardly rise above the noise."""
    measurements = arm_with(tmp_path_factory.mktemp("quiet") / "set", 0.05)
    own = layout_of(measurements)
    return Fine(FitContext(measurements, own), own, lambda _: None)


def test_drops_in_the_band_of_the_motion_agree_with_fits(exact: Coarse, coarse: CoarseModel) -> None:
    found = needs(exact.linearised(coarse), coarse.score, exact)
    assert (
        len(found) == 7 and {e: need for e, (need, _) in found.items()}.keys() == exact.gains(coarse).keys()
    )
    for effect, (need, x) in found.items():
        layout = without(coarse.layout, [effect])
        there = exact.fit(layout, exact.towards(coarse, x, layout), iterations=0)  # only evaluated
        assert need.delta == pytest.approx(gain(there.score, coarse.score).delta, rel=0.03, abs=0.3), effect
        smaller = exact.fit(layout, layout.vector(coarse.layout.model(coarse.fit.x)))
        refitted = gain(smaller.score, coarse.score)
        assert need.delta == pytest.approx(refitted.delta, rel=0.1, abs=1.0), effect
        assert need.accepted == refitted.accepted == (effect in HIDDEN)


def test_a_drop_with_another_effect_at_its_bound_agrees_with_a_fit(exact: Coarse) -> None:
    """Whatever the order of the effects."""
    found = []
    for effects in ((*HIDDEN, OFFSETS[1], QUADRATIC[0]), (QUADRATIC[0], OFFSETS[1], *HIDDEN)):
        layout = Layout(exact.own.joints, effects)
        model = exact.fit(layout, exact.context.start(layout).x)
        found.append(exact.gains(model)[COULOMB[1]].delta)
        rest = without(layout, [COULOMB[1]])
        smaller = exact.fit(rest, rest.vector(layout.model(model.fit.x)))
        assert found[-1] == pytest.approx(gain(smaller.score, model.score).delta, rel=0.1)
    assert found[0] == pytest.approx(found[1], rel=0.02)


def test_what_is_left_after_drops_is_what_is_hidden(exact: Coarse, coarse: CoarseModel) -> None:
    """One by one with a fit each, and in closed form."""
    for pruned in (Search(exact).pruned(coarse), exact.pruned_of(coarse, exact.own)):
        assert set(pruned.layout.effects) == set(HIDDEN)
        for effect, where in pruned.layout.effect_slices():
            assert pruned.fit.x[where][0] == pytest.approx(HIDDEN[effect], rel=0.05)


def test_what_is_below_the_tolerance_is_not_needed(view: Coarse) -> None:
    """It saves all that it costs, however well the data determine it."""
    whole = whole_model(view)
    for effect, need in view.gains(whole).items():
        if effect not in COULOMB:
            assert need.delta == pytest.approx(-view.cost_of(effect), abs=0.01)
            assert not need.by_joint.any()
    assert set(Search(view).pruned(whole).layout.effects) == set(COULOMB)


def test_scores_in_the_band_of_the_motion_agree_with_fits(exact: Coarse, coarse: CoarseModel) -> None:
    for effect in SMALL:
        layout = without(coarse.layout, [effect])
        fit = exact.fit(layout, layout.vector(coarse.layout.model(coarse.fit.x))).fit
        (score,) = exact.scores(fit, [effect])
        start = with_effects(fit, {effect: score.values})
        larger = exact.fit(start.layout, start.x).fit
        # of the squares, in the weights of the smaller model, and of the prior; new ones move sizes
        before, after = (
            np.sum((one.residual * fit.weights) ** 2) + 2 * exact.context.start(one.layout).prior.value(one.x)
            for one in (fit, larger)
        )
        assert score.gain == pytest.approx(before - after, rel=0.05), effect
        assert score.values == pytest.approx(larger.x[larger.layout.effect_slice(effect)], rel=0.04)


def test_drops_and_scores_near_the_noise_agree_with_fits(fine: Fine) -> None:
    layout = Layout(fine.own.joints, tuple(HIDDEN))
    whole: FineModel = fine.begin(layout, fine.context.start(layout).x)
    drops = fine.gains(whole)
    for effect in SMALL:
        smaller = without(layout, [effect])
        base = fine.refit(whole, smaller, smaller.vector(layout.model(whole.fit.x)))
        refitted = gain(base.score, whole.score)
        assert drops[effect].delta == pytest.approx(refitted.delta, rel=0.05, abs=1.0), effect
        (score,) = fine.scores(base.fit, [effect])
        start = with_effects(base.fit, {effect: score.values})
        larger = fine.refit(base, start.layout, start.x).fit
        decrease = np.sum(base.fit.point.r**2) - np.sum(larger.point.r**2)
        assert score.gain == pytest.approx(decrease, rel=0.1, abs=0.5), effect
        assert score.values == pytest.approx(larger.x[larger.layout.effect_slice(effect)], rel=0.02)
