"""A model that was estimated beside free curves ends with them, as steps that are not physics."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from flexviz import diagnose, identify
from flexviz.analysis.diagnosis import Diagnosis, why_no_curve
from flexviz.content.records import curve_tables
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.outlets.batch.rows import fleet_row
from flexviz.outlets.batch.sources import BatchSet
from flexviz.outlets.batch.tasks import TaskResult
from tests.unknown_laws import Rough, set_with

SHARED = Path(__file__).parents[3] / "shared" / "robotlike"
LAW = Rough()


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """Friction of up to 3 Nm in a part of joint 2's range."""
    return set_with(lambda _: LAW, 1, tmp_path_factory.mktemp("rough") / "set")[0]


@pytest.fixture(scope="module")
def ended(rough: MeasurementSet) -> Diagnosis:
    return diagnose(rough, apply=True)


@pytest.fixture(scope="module")
def without(rough: MeasurementSet) -> Diagnosis:
    return diagnose(rough, apply=True, free_curve=False)


def test_the_curve_is_the_hidden_law(ended: Diagnosis) -> None:
    (table,) = curve_tables(ended.parameters)
    assert ended.model is not None
    constant = sum(e.parameters["coulomb"] for e in ended.model.effects if e.effect == "coulomb_friction")
    forward, backward = np.array(table.value)
    angles = np.array(table.at)
    hidden = LAW.peak * np.exp(-(((angles - LAW.position) / LAW.width) ** 2))
    np.testing.assert_allclose(
        (forward + constant)[1:-1], hidden[1:-1], atol=0.1
    )  # the ends are beyond the motion
    np.testing.assert_array_equal(backward, -forward)


def test_it_is_a_step_of_its_own_and_the_verdict_stays(ended: Diagnosis) -> None:
    before, last = ended.steps[-2:]
    assert (before.verdict, last.verdict) == ("unknown", "unknown")
    assert last.added is not None and last.added.stopgap and last.added.text == "free_curve_friction:joint2"
    assert before.rms_validation and last.rms_validation and ended.model is not None
    assert last.rms_validation[1] < 0.05 * before.rms_validation[1]
    assert last.added.score > 0.99
    assert sum(e.text == last.added.text for e in ended.model.effects) == 1
    assert not any(finding.stopgap for finding in ended.findings)  # it is no candidate


def test_the_law_is_still_located_and_what_is_left_is_mapped(ended: Diagnosis, without: Diagnosis) -> None:
    place = ended.where[0]
    assert (place.joint, place.variable) == ("joint2", "position") and place.explained > 0.5
    # half of what it explains, most of it where the arm is most of the time: on the slope of the bump
    assert max(abs(end - LAW.position) for end in place.range) < 1.5 * LAW.width
    assert [(w.joint, w.variable) for w in ended.where] == [(w.joint, w.variable) for w in without.where]
    curve = without.free_curve
    assert curve is not None and curve.certain and curve.joint == "joint2" and curve.variable == "position"
    why = why_no_curve(ended)
    assert why is not None and why.joints == ("joint2",) and not why_no_curve(without)


def test_left_out_it_changes_no_parameter(ended: Diagnosis, without: Diagnosis) -> None:
    assert without.model is not None and without.steps[-1].verdict == "unknown"
    assert not any(step.added is not None and step.added.stopgap for step in without.steps)
    assert len(without.steps) == len(ended.steps) - 1
    for p in without.parameters:
        other = ended[p.name, p.joint]  # one that the data do not show has no error
        assert (p.value, p.std) == pytest.approx((other.value, other.std), nan_ok=True)
    assert without["stiffness", "joint2"].value == pytest.approx(1100, rel=0.02)


def test_a_document_states_its_extremes_and_no_confidence(ended: Diagnosis) -> None:
    document = ended.to_dict()
    assert document["steps"][-1]["added"]["confidence"] is None
    (line,) = (
        line
        for line in ended.summary().splitlines()
        if line.startswith("then added") and "free" in line.lower()
    )
    assert "value_1" not in line and "confidence" not in line
    assert re.search("joint2 along position: .* of what no effect explains", ended.summary())


def test_a_fleet_lists_effects_and_their_parameters_only(ended: Diagnosis, rough: MeasurementSet) -> None:
    found = {"identification": identify(rough).to_dict(), "diagnosis": ended.to_dict()}
    row = fleet_row(BatchSet("rough", rough.path, "arm"), "key", TaskResult(key="key", result=found))
    assert row.state == "done" and row.final_verdict == "unknown"
    assert not any("free_curve" in name for name in row.found)
    assert "stiffness:joint2" in row.parameters and not any("free_curve" in name for name in row.parameters)


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.is_dir(), reason="the robot-like sets are not beside this checkout")
def test_beside_seven_effects_the_error_is_that_of_the_noise() -> None:
    truth = json.loads((SHARED / "truth" / "robotlike-2r-03.json").read_text())
    (law,) = (e for e in truth["effects"] if e["effect"] == "unknown")
    measurements = read_set(SHARED / "cases" / "robotlike-2r-03")
    result = diagnose(measurements, apply=True)
    before, last = result.steps[-2:]
    assert last.added is not None and last.added.stopgap and last.added.joint == law["joint"]
    assert (before.verdict, last.verdict) == ("unknown", "unknown")
    assert np.all(np.array(last.rms_validation) < 1.2 * np.array(last.noise_floor))
    assert result.where[0].joint == law["joint"]
    plain = diagnose(measurements, apply=True, free_curve=False)
    assert not any(step.added is not None and step.added.stopgap for step in plain.steps)
    assert {f.text for f in plain.findings} == {f.text for f in result.findings}
