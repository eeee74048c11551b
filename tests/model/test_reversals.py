"""Reversals that a record hardly shows: quick ones, those of the link, those near its ends."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.diagnosis_study.cases import selected
from benchmarks.diagnosis_study.making import case_folder, make
from flexviz import diagnose
from flexviz.analysis.diagnosis.fit_context import SEARCH_WEIGHTING, FitContext
from flexviz.analysis.identification import identify
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import EFFECTS, LawEffect
from flexviz.model.equation import layout_of
from flexviz.model.equation.reversal_nuisance import undecided
from tests.model.test_equation_parts import moving

SOFT = "clean-2r-009-link_coulomb_friction"  # links that stick and break loose, in the set's own model
SOFTER = "clean-2r-069-link_coulomb_friction"
LARGE = "single-2r-231-backlash"  # 2.4 mrad to either side, whose impacts let a light link ring
LATE = "single-2r-011-backlash"  # crossed once, 1.1 s after the start of a record


def simulated(work: Path, name: str, seed: int = 47) -> MeasurementSet:
    """A set of the diagnosis study."""
    (case,) = selected(seed, name)
    make(work, case)
    return read_set(case_folder(work, name))


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return simulated(tmp_path_factory.mktemp("large"), LARGE, 109)


@pytest.mark.parametrize("acceleration", [3.0, 16.0, 80.0])
def test_a_reversal_between_two_samples_has_its_pulses(acceleration: float) -> None:
    """However quick: between two samples the velocity passes all that friction needs to change sign."""
    motion = moving(acceleration * (np.arange(1001) / 500.0 - 1.0007))
    for name, per_sample in (("coulomb_friction", 1.0), ("quadratic_friction", 0.0)):
        law = EFFECTS[name]
        assert isinstance(law, LawEffect)
        times, sizes = undecided(law, motion, np.array([2.0]))
        assert bool(len(times)) == bool(per_sample)
        if len(times):
            assert times[0] < 1.0007 < times[-1] and np.ptp(times) < 0.025
            np.testing.assert_allclose(sizes, 0.15 * 4.0 * np.ptp(times) / (len(times) - 1), rtol=0.35)


@pytest.mark.slow
@pytest.mark.parametrize("name", [SOFT, SOFTER])
def test_a_right_model_of_links_that_stick_leaves_only_noise(tmp_path: Path, name: str) -> None:
    measurements = simulated(tmp_path, name)
    layout = layout_of(measurements)
    context = FitContext(measurements, layout)
    fit = context.fit(layout, layout.vector(identify(measurements).model), iterations=6)
    assert fit.chi.max() < 1.3 and fit.chi_held_out.max() < 1.3  # 7.5 and 64 without the reversals' detail
    assert diagnose(measurements, apply=True).verdict == "nothing-missing"
    plain = identify(measurements, observer="flat-zero-phase")  # from values too rough for such detail
    assert max(plain.residual.rms) < 1.5 and plain.converged  # 2.6 and 4.3 Nm with it


@pytest.mark.slow
def test_what_a_model_leaves_near_the_ends_counts(tmp_path: Path) -> None:
    """A tilted base imitates a backlash until it is crossed, which looks like a transient."""
    measurements = simulated(tmp_path, LATE)
    layout = layout_of(measurements)
    context = FitContext(measurements, layout)
    bare = context.fit(layout, layout.vector(identify(measurements).model), iterations=10)
    point, left = bare.point, ~bare.point.used
    assert 10 < np.count_nonzero(left) < 0.1 * len(left)
    assert point.transients > 100.0  # from where an effect is worth its place
    first = diagnose(measurements, apply=True).findings[0]
    assert (first.effect, first.joint) == ("backlash", "joint1")


@pytest.mark.slow
def test_impacts_of_a_large_backlash_leave_only_noise(large: MeasurementSet) -> None:
    found = diagnose(large, apply=True)
    first = found.findings[0]
    assert (first.effect, first.joint) == ("backlash", "joint2") and first.confidence > 0.9
    assert found.steps[-1].verdict == "nothing-missing"


def test_impacts_of_a_large_backlash_need_products_before_the_filter(large: MeasurementSet) -> None:
    effects = ["backlash:joint2"]
    layout = layout_of(large, effects)
    near = layout.vector(identify(large, effects=effects, refine=True).model)
    after = FitContext(large, layout)
    before = FitContext(large, layout, replace(SEARCH_WEIGHTING, products=True))
    assert after.fit(layout, near, iterations=6).chi.max() > 10.0  # products of filtered signals
    fit = before.fit(layout, near, iterations=6)
    assert fit.chi.max() < 1.3 and fit.chi_held_out.max() < 1.3
    assert fit.x[-1] == pytest.approx(0.0024016, rel=1e-3)
