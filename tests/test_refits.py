"""Candidates refitted on all cores."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flexviz.diagnosis.comparison import unscored
from flexviz.diagnosis.refits import best_refits

from flexviz.diagnosis import restart
from flexviz.diagnosis.candidates import ModelStart, with_effect
from flexviz.diagnosis.fit_context import Fit
from flexviz.effects import ChosenEffect
from flexviz.measurements import MeasurementSet
from flexviz.parallel import on_cores
from tests.unknown_laws import search_of


@pytest.mark.parametrize("cores", [1, 2])
def test_the_best_refit_of_each_effect_is_evaluated_in_this_process(demo: MeasurementSet, cores: int) -> None:
    fit = search_of(demo).base
    spring, offset = (ChosenEffect(name, 1) for name in ("cable_spring", "torque_offset"))
    trials = []
    # objective and excess of a refit from each start; the first parameter tells the starts apart
    ends = {1.0: (30.0, 2.0), 2.0: (10.0, 2.0), 3.0: (20.0, 2.0), 4.0: (5.0, 9.0)}
    for effect, mark in ((spring, 1.0), (spring, 2.0), (spring, 3.0), (offset, 4.0)):
        values = np.full(2 if effect == spring else 1, mark)
        trials.append((unscored(effect, fit), with_effect(fit.layout, fit.x, effect, values)))

    def refit(start: ModelStart) -> Fit:
        objective, left = ends[start.x[fit.layout.size]]
        chi = np.full(2, 1.0 + left)
        return replace(
            fit,
            layout=start.layout,
            x=start.x,
            objective=objective,
            chi=chi,
            chi_held_out=chi,
            converged=True,
        )

    evaluated: list[float] = []

    def evaluate(model: ModelStart) -> Fit:
        evaluated.append(float(model.x[fit.layout.size]))
        return replace(fit, layout=model.layout, x=model.x, converged=False)

    with on_cores(cores):
        found = best_refits(trials, refit, evaluate)
        assert [r.effect for r in found] == [spring, offset] and evaluated == [2.0, 4.0]
        assert all(r.fit.converged for r in found)
        (alone,) = best_refits(trials[:1], refit, evaluate)
        assert alone.fit.objective == 30.0 and evaluated == [2.0, 4.0]  # it was made in this process
        found = best_refits(trials, refit, evaluate, most=5.0)
    assert [r.effect for r in found] == [spring]


@pytest.mark.parametrize(
    ("left", "gain", "doubted"), [(0.3, 89.0, False), (0.3, 91.0, True), (6.0, 1.0, True)]
)
def test_a_gain_beyond_an_effects_size_is_doubted(
    monkeypatch: pytest.MonkeyPatch, left: float, gain: float, doubted: bool
) -> None:
    """Of an effect three standard errors from zero, near the noise; far from it, any."""
    monkeypatch.setattr(restart, "excess", lambda fit: fit.left)
    monkeypatch.setattr(restart, "size_in_errors", lambda *_: 3.0)
    present: Any = SimpleNamespace(objective=1000.0, left=left)
    best: Any = SimpleNamespace(fit=SimpleNamespace(objective=1000.0 - gain), effect=None)
    nothing: Any = None
    assert restart.Restart(nothing, nothing).advisable(present, best) == doubted
