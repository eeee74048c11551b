"""Alternatives to a law of the model: how long a fit with one is worth going on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flexviz.diagnosis.rich_search import RichSearch

from flexviz.diagnosis.motion_fit import FAIR_STEPS, MAX_ITERATIONS, MotionFit, MotionProblem
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.measurements import read_set
from tests.test_backwards_search import fitted, search_of

DEMO = Path(__file__).parents[1] / "sessions" / "planar-2r-demo"
COULOMB, BY_LOAD = ChosenEffect("coulomb_friction", 1), ChosenEffect("load_dependent_friction", 1)


@pytest.fixture(scope="module")
def demo() -> RichSearch:
    """Of the demonstration, which hides Coulomb friction of 3 Nm on joint 2."""
    return search_of(read_set(DEMO))


def test_a_fit_is_asked_for_its_hope_with_what_it_gains_at_the_pace_of_its_last_step(demo):
    layout = Layout(demo.own.joints, (BY_LOAD,))
    start = demo.context.start(layout).x.copy()
    start[: layout.effect_start] *= 3.0
    seen: list[tuple[float, float]] = []

    def hopeless(fit: MotionFit, more: float) -> bool:
        seen.append((fit.objective, more))
        return len(seen) == 2

    whole = [demo.context.fit(layout, start, iterations=k).objective for k in range(FAIR_STEPS + 2)]
    found = demo.context.fit(layout, start, hopeless=hopeless)
    gains = -np.diff(whole)[-2:] * (MAX_ITERATIONS - FAIR_STEPS - np.arange(2))
    assert gains[1] > 0
    np.testing.assert_allclose(seen, list(zip(whole[-2:], gains, strict=True)), rtol=1e-6)
    assert found.objective == pytest.approx(whole[-1])


def test_a_law_that_cannot_catch_up_is_given_up_early(demo, monkeypatch):
    """Friction by the load instead of Coulomb friction leaves fifty times as much."""
    fit = fitted(demo, (COULOMB, [3.0]))
    evaluated: list[float] = []
    weighted = MotionProblem.at

    def counted(*args) -> MotionFit:
        found = weighted(*args)
        evaluated.append(found.objective)
        return found

    monkeypatch.setattr(MotionProblem, "at", counted)
    full = demo.swapped(fit, fit, {COULOMB: BY_LOAD})
    patient = len(evaluated)
    assert full.sigma[1] > 20 * fit.sigma[1]
    needed = demo.thinned(fit)[1]
    evaluated.clear()
    kept, still = demo.better_of(fit, needed, {COULOMB: BY_LOAD})
    assert kept is fit and still is needed
    assert min(evaluated) > fit.objective
    assert 2 * FAIR_STEPS < len(evaluated) < patient
