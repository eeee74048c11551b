"""What is evidence for an effect: how far its size is from none, and how many samples J counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.diagnosis.candidates import with_offsets_merged
from flexviz.analysis.diagnosis.course import apart_from_none
from flexviz.analysis.diagnosis.criterion import Gain
from flexviz.analysis.estimation import Covariance
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import ChosenEffect
from tests.analysis.test_resolution import COULOMB, OFFSET, SPRING, coarse_of, fitted

THINNING = ChosenEffect("thinning_friction", 1)
WHERE = slice(3, 5)


def errors(stated: float, chance: float) -> tuple[Covariance, Covariance]:
    """Covariances of five parameters, all with these standard errors."""
    return tuple(Covariance(np.eye(5) * error**2, np.zeros(5)) for error in (stated, chance))  # type: ignore[return-value]


def needed(nats: float) -> Gain:
    return Gain(nats - 10.0, np.array([0.0, nats]), 0.0)


def test_a_size_is_as_far_from_none_as_its_standard_error_or_its_likelihood_says() -> None:
    x = np.array([0.0, 0.0, 0.0, 2.0, 0.1])
    assert apart_from_none(x, COULOMB, slice(3, 4), errors(0.5, 0.5), None) == pytest.approx(4.0)
    assert apart_from_none(x, THINNING, WHERE, errors(2.0, 2.0), needed(0.0)) == pytest.approx(1.0)
    # a likelihood that falls by z²/2 without it
    assert apart_from_none(x, THINNING, WHERE, errors(2.0, 2.0), needed(50.0)) == pytest.approx(10.0)
    # the model's own error weakens that as it widens the interval
    assert apart_from_none(x, THINNING, WHERE, errors(8.0, 2.0), needed(50.0)) == pytest.approx(2.5)


def test_without_a_spring_its_constant_torque_is_missing_too_and_is_no_evidence_for_it() -> None:
    x = np.array([0.0, 0.0, 0.0, 2.0, 0.1])
    assert apart_from_none(x, SPRING, WHERE, errors(4.0, 1.0), needed(500.0)) == pytest.approx(0.5)


def test_a_spring_that_goes_leaves_its_constant_torque(demo: MeasurementSet) -> None:
    view = coarse_of(demo)
    merged = with_offsets_merged(fitted(view, COULOMB, SPRING, OFFSET).fit, view.own)
    model = view.fit(merged.layout, merged.x)
    assert OFFSET not in model.layout.effects
    assert set(view.without(model, SPRING).layout.effects) == {COULOMB, OFFSET}
    assert set(view.without(model, COULOMB).layout.effects) == {SPRING}
    view.banned = frozenset({OFFSET})
    assert set(view.without(model, SPRING).layout.effects) == {COULOMB}


def test_samples_are_counted_anew_only_where_what_is_left_is_more_independent(demo: MeasurementSet) -> None:
    """With dry friction in the model, what is left of joint 2 is noise instead of its square wave."""
    view = coarse_of(demo)
    bare = view.begin()
    before = view.criterion.samples.copy()
    assert view.renewed(bare) is None  # it is the model by which J is measured
    right = fitted(view, COULOMB)
    quiet = replace(view.criterion, least=np.full(view.own.n, 1e9))
    loud = replace(view.criterion, least=np.zeros(view.own.n))
    view._criterion = quiet
    assert view.renewed(right) is None  # nothing is left that counts
    view._criterion = loud
    found = view.renewed(right)
    assert found is not None and set(found.layout.effects) == {COULOMB}
    assert view.criterion.samples[1] > 1.5 * before[1] and np.all(view.criterion.samples >= before)
    assert view.renewed(found) is None
