"""The observer guard: nothing moves on clean data; lagging observers and missing effects are told apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis import bandwidth_check
from flexviz.analysis.diagnosis.bandwidth_check import (
    BandwidthCheck,
    bandwidths,
    check_bandwidth,
)
from flexviz.analysis.estimation import TwoBandData
from flexviz.analysis.identification import identify
from flexviz.base.statistics import NORMAL_95
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import choose_effects
from flexviz.model.equation import Layout
from tests.analysis.test_where import patch, with_hidden

KUKA = Path(__file__).resolve().parents[3] / "shared" / "real" / "kuka_kr300"
EVERYTHING = ("coulomb_friction:joint2",)  # what the demonstration's robot has


def model(measurements: MeasurementSet, effects: tuple[str, ...]) -> tuple[Layout, np.ndarray]:
    """A plain fit."""
    layout = Layout(measurements.joints, choose_effects(effects, measurements.joints))
    return layout, layout.vector(identify(measurements, effects=effects, refine=False).model)


@pytest.fixture(scope="module")
def complete(demo) -> tuple[Layout, np.ndarray]:
    return model(demo, EVERYTHING)


@pytest.fixture(scope="module")
def clean(demo, complete) -> BandwidthCheck:
    return check_bandwidth(demo, *complete)


def test_nothing_moves_where_nothing_is_wrong(clean):
    assert not clean.observer_error.any() and not clean.untrusted and not any(clean.facts())
    assert np.all(np.diff(clean.bandwidths) > 0) and clean.bandwidths[clean.in_use] == clean.bandwidths[-2]
    assert np.all(clean.change < clean.noise_floor)
    names = {(p.name, p.joint) for p in clean.parameters}
    assert {("stiffness", "joint1"), ("coulomb_friction.coulomb", "joint2"), ("mx:joint2", None)} <= names
    stiffness = next(p for p in clean.parameters if (p.name, p.joint) == ("stiffness", "joint1"))
    np.testing.assert_allclose(stiffness.values, 1000.0, rtol=2e-3)


def test_a_missing_effect_moves_what_had_absorbed_it(demo):
    hidden = with_hidden(demo, 1, patch)
    found = check_bandwidth(hidden, *model(hidden, EVERYTHING))
    assert np.all(found.rms[found.in_use] > 30 * found.noise_floor)
    assert not found.observer_error.any()
    assert ("stiffness", "joint2") in {(p.name, p.joint) for p in found.untrusted}
    moved = next(p for p in found.untrusted if (p.name, p.joint) == ("stiffness", "joint2"))
    assert np.ptp(moved.values) > NORMAL_95 * moved.std[found.in_use]
    assert ("stiffness", ("joint2",)) in {(f.values["parameter"], f.joints) for f in found.facts()}


def test_a_band_whose_products_are_wrong_is_found_out(demo, complete, monkeypatch):
    def plain(*args) -> list[TwoBandData]:
        bands = bandwidths(*args)
        for band in bands:
            band._products = None
        return bands

    monkeypatch.setattr(bandwidth_check, "bandwidths", plain)
    monkeypatch.setattr(bandwidth_check, "WIDE_HERTZ", 2.0)  # in use; friction's steps do not end there
    monkeypatch.setattr(bandwidth_check, "FACTORS", (2.0 / 14, 4.0 / 14))
    found = check_bandwidth(demo, *complete)
    assert found.observer_error.any() and any("change" in fact.values for fact in found.facts())


@pytest.mark.slow
@pytest.mark.skipif(not KUKA.exists(), reason="the real robot's recording is not beside this checkout")
def test_stiffness_of_a_real_robot_moves():
    whole = read_set(KUKA)
    measurements = replace(whole, groups=whole.fit_groups)  # what is held out is not looked at
    effects = ("coulomb_friction",)
    found = check_bandwidth(measurements, *model(measurements, effects))
    assert not found.observer_error.any()
    assert "stiffness" in {p.name for p in found.untrusted}
