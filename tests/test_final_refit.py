"""The last fit's closer weighting: nearer to the truth, and refused where the model does not explain all."""

from __future__ import annotations

import numpy as np
import pytest
from flexviz.diagnosis.final_refit import EarlyRefit, FinalRefit, final_refit

from flexviz.diagnosis import final_refit as refits
from flexviz.diagnosis.candidates import ModelStart
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.equation import layout_of
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from flexviz.simulation import inject, make_plan, simulate_plan, write_plan
from tests.planar_arm import of_groups

HIDDEN = ("coulomb_friction:joint2", "stribeck_friction:joint2:stribeck=0.4,velocity=0.08")
PLAN = inject(of_groups(make_plan("planar-2r")), HIDDEN)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """A planar arm with friction that falls with speed."""
    return read_set(write_plan(PLAN, simulate_plan(PLAN), tmp_path_factory.mktemp("sharp") / "set"))


def fitted(measurements: MeasurementSet, effects: tuple[str, ...]) -> tuple[FitContext, Fit]:
    """A model with these effects, fitted as the diagnosis judges it."""
    layout = layout_of(measurements, effects)
    context = FitContext(measurements, layout)
    start = layout.vector(identify(measurements, effects=effects).model)
    return context, context.fit(layout, start, iterations=20)


def test_values_are_the_truth_within_smaller_intervals(made: MeasurementSet) -> None:
    context, fit = fitted(made, ("coulomb_friction:joint2", "stribeck_friction:joint2"))
    closer = final_refit(made, fit, lambda: None)
    assert closer is not None
    std = closer.covariance.standard_errors
    wide = context.covariance(fit).standard_errors
    known = closer.covariance.prior_share < 0.01  # by the data
    assert known.sum() >= 10
    assert np.exp(np.mean(np.log(std[known] / wide[known]))) < 0.95
    true = fit.layout.vector(PLAN.model)
    deviations = (closer.x - true)[known] / std[known]
    assert np.abs(deviations).max() < 5 and np.sqrt(np.mean(deviations**2)) < 2


def test_what_does_not_explain_all_keeps_its_values(made: MeasurementSet) -> None:
    _, fit = fitted(made, ("coulomb_friction:joint2",))
    assert fit.chi.max() > 1.5  # something is missing
    closer = final_refit(made, fit, lambda: None)
    assert closer is None


def test_it_can_be_stopped(made: MeasurementSet) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    _, fit = fitted(made, ("coulomb_friction:joint2",))
    with pytest.raises(KeyboardInterrupt):
        final_refit(made, fit, stop)


def test_an_early_refit_is_used_for_its_own_model_and_minimum(
    made: MeasurementSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, fit = fitted(made, ("coulomb_friction:joint2", "stribeck_friction:joint2"))
    closer = final_refit(made, fit, lambda: None)
    assert closer is not None
    std, starts = closer.covariance.standard_errors, []
    away = fit.x + 0.3 * std  # where the search has not ended yet

    def counted(measurements: MeasurementSet, start: ModelStart, check: object) -> FinalRefit:
        starts.append(start)
        moved = closer.x + (30 * std if wrong else 0 * std)
        return FinalRefit(moved, closer.covariance, closer.chi)

    monkeypatch.setattr(refits, "_refit", counted)
    for wrong, layout, used in ((False, fit.layout, 1), (True, fit.layout, 2), (False, layout_of(made), 1)):
        starts.clear()
        early = EarlyRefit(made, lambda: None)
        early.begin(ModelStart(layout, away[: layout.size]))
        early.begin(ModelStart(layout, away[: layout.size]))  # the same model: goes on
        found = early.of(fit)
        assert found is not None and len(starts) == used
        assert starts[-1].layout == fit.layout
        # another minimum or another model: from the fit itself
        np.testing.assert_array_equal(starts[-1].x, away if not wrong and layout == fit.layout else fit.x)
