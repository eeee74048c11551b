"""A model that was estimated beside free curves ends with them, as steps that are not physics."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from flexviz.diagnosis.many_effects import ManyEffects

from flexviz import diagnose, identify
from flexviz.batch.rows import fleet_row
from flexviz.batch.sources import BatchSet
from flexviz.batch.tasks import TaskResult
from flexviz.diagnosis import Diagnosis, why_no_curve
from flexviz.diagnosis.model_family import RichModel
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.so_far import Standing
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.measurements import MeasurementSet, read_set
from flexviz.results import curve_tables

DEMO = Path(__file__).parents[1] / "sessions" / "planar-2r-demo"
SHARED = Path(__file__).parents[2] / "shared" / "robotlike"
LAW, OTHER = ChosenEffect("free_curve_friction", 1), ChosenEffect("free_curve_position", 0)


@pytest.fixture(scope="module")
def demo() -> MeasurementSet:
    """Hides Coulomb friction of 3 Nm on joint 2."""
    return read_set(DEMO)


def result_with(demo: MeasurementSet, curves: tuple[ChosenEffect, ...], kept: bool) -> Diagnosis:
    own = Layout(demo.joints)
    band = PredictionErrorBand(demo)
    many = ManyEffects(demo, own, band, lambda _: None, Standing(own, band, None))
    layout = Layout(demo.joints, curves)
    fit = many.context.fit(layout, many.context.start(layout).x)
    return many.result(RichModel(fit, {}, curves), True, kept, False, lambda _: None)


@pytest.fixture(scope="module")
def ended(demo: MeasurementSet) -> Diagnosis:
    return result_with(demo, (LAW,), kept=True)


@pytest.fixture(scope="module")
def without(demo: MeasurementSet) -> Diagnosis:
    return result_with(demo, (LAW,), kept=False)


def test_the_curve_is_the_hidden_law(ended: Diagnosis) -> None:
    (table,) = curve_tables(ended.parameters)
    forward, backward = np.array(table.value)
    np.testing.assert_allclose(forward[1:-1], 3.0, rtol=0.05)  # the ends are beyond the motion
    np.testing.assert_array_equal(backward, -forward)


def test_it_is_a_step_of_its_own_and_the_verdict_stays(ended: Diagnosis) -> None:
    first, last = ended.steps
    assert (first.verdict, last.verdict, ended.verdict) == ("unknown", "unknown", "unknown")
    assert last.added is not None and last.added.stopgap and last.added.text == "free_curve_friction:joint2"
    assert first.rms_validation and last.rms_validation and ended.model is not None
    assert last.rms_validation[1] < 0.05 * first.rms_validation[1]
    assert last.added.score > 0.99 and last.added.gain > 100
    assert [effect.text for effect in ended.model.effects] == [last.added.text]
    (note,) = (note.text for note in ended.notes if note.kind == "stopgap")
    assert note.startswith("not physics, but in the model: free_curve_friction:joint2")


def test_the_law_is_still_located_and_what_is_left_is_mapped(ended: Diagnosis, without: Diagnosis) -> None:
    place = ended.where[0]
    assert (place.joint, place.variable) == ("joint2", "velocity") and place.explained > 0.8
    assert ended.where == without.where
    assert ended.free_curve is None and "joint2" in why_no_curve(ended) and not why_no_curve(without)
    assert {one.variable: one.explained for one in ended.maps if one.joint == "joint2"}["velocity"] < 0.2


def test_left_out_it_changes_no_parameter(ended: Diagnosis, without: Diagnosis) -> None:
    (only,) = without.steps
    assert only.verdict == "unknown" and without.model is not None and not without.model.effects
    for p in without.parameters:
        assert (p.value, p.std) == (ended[p.name, p.joint].value, ended[p.name, p.joint].std)
    assert without["stiffness", "joint2"].value == pytest.approx(1100, rel=0.01)
    assert without.free_curve is not None and without.free_curve.certain


def test_several_are_added_one_at_a_time(demo: MeasurementSet) -> None:
    result = result_with(demo, (LAW, OTHER), kept=True)
    added = [step.added.text for step in result.steps if step.added is not None]
    assert added == ["free_curve_friction:joint2", "free_curve_position:joint1"]
    first, one, both = ((step.rms_validation or step.rms)[1] for step in result.steps)
    assert one < 0.05 * first and one == pytest.approx(both, rel=0.2)
    assert result.steps[1].model is not None and len(result.steps[1].model.effects) == 1


def test_a_document_states_its_extremes_and_no_confidence(ended: Diagnosis) -> None:
    document = ended.to_dict()
    assert document["steps"][1]["added"]["confidence"] is None
    (line,) = (line for line in ended.summary().splitlines() if line.startswith("then added"))
    assert " rad: " in line and "value_1" not in line and "confidence" not in line
    assert "what no effect explains on joint2 follows velocity" in ended.summary()


def test_a_fleet_lists_effects_and_their_parameters_only(ended: Diagnosis, demo: MeasurementSet) -> None:
    found = {"identification": identify(demo).to_dict(), "diagnosis": ended.to_dict()}
    row = fleet_row(BatchSet("demo", demo.path, "arm"), "key", TaskResult(key="key", result=found))
    assert row.state == "done" and row.final_verdict == "unknown" and row.found == ()
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
    assert plain.steps[-1].rms_validation == pytest.approx(before.rms_validation)
