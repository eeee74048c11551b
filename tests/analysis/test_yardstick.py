"""One measure of every error: the same band, noise and units for all models of a set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis, prediction_errors
from flexviz.analysis.estimation import ErrorBand, torque_scale
from flexviz.analysis.identification import Identification, identify
from flexviz.base.arrays import Array
from flexviz.content.results import staircase_chart
from flexviz.content.wording import JointErrors, stated_errors
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Layout, layout_of


@dataclass(frozen=True, eq=False)
class Model:
    layout: Layout
    x: Array


@pytest.fixture(scope="module")
def plain(demo: MeasurementSet) -> Identification:
    return identify(demo, refine=False)


def with_gain(demo: MeasurementSet, plain: Identification, gain: float) -> Model:
    """The model with a gain on joint 2."""
    layout = layout_of(demo, ["torque_gain:joint2"])
    x = layout.vector(plain.model)
    x[-1] = gain
    return Model(layout, x)


def test_an_error_is_in_units_of_the_recorded_torque(demo: MeasurementSet, plain: Identification) -> None:
    band, model = ErrorBand(demo), with_gain(demo, plain, -0.8)
    assert torque_scale(model.layout, model.x) == pytest.approx([1.0, 0.2])
    applied = band.at(model).residual(model.x)
    told = band.judged(model)
    np.testing.assert_allclose(told.residual[:, 1], applied[:, 1] / 0.2)
    np.testing.assert_array_equal(told.residual[:, 0], applied[:, 0])
    rows = np.concatenate([band.rows[group.name] for group in demo.fit_groups])
    assert told.rms[1] == pytest.approx(np.sqrt(np.mean((applied[rows, 1] / 0.2) ** 2)))


def test_a_fit_with_a_gain_tells_its_error_in_the_same_units(demo: MeasurementSet) -> None:
    """In units of the applied torque a gain near its bound would shrink any error to a fifth."""
    free = identify(demo, effects=["torque_gain:joint2"], refine=False)
    found = prediction_errors(demo, free.model, ["torque_gain:joint2"])
    assert free.residual.rms == pytest.approx(found.rms)
    layout = layout_of(demo, ["torque_gain:joint2"])
    model = Model(layout, layout.vector(free.model))
    rows = ErrorBand(demo).rows["t4p2"]
    applied = ErrorBand(demo).at(model).residual(model.x)[rows, 1]
    gain = free["torque_gain.gain_error", "joint2"].value
    assert free.residual.rms_validation is not None
    assert free.residual.rms_validation[1] == pytest.approx(np.sqrt(np.mean(applied**2)) / (1 + gain))


@pytest.mark.parametrize(
    "options", [{}, {"observer": "eso", "bandwidth": 60.0}, {"effects": ["coulomb_friction"]}]
)
def test_identify_tells_the_error_and_noise_of_the_diagnosis(
    demo: MeasurementSet, diagnosed_demo: Diagnosis, options: dict
) -> None:
    """Whatever the observer of the fit; the residual over time is that of its own."""
    result = identify(demo, refine=False, **options)
    errors = prediction_errors(demo, result.model, options.get("effects", ()))
    residual = result.residual
    assert (residual.rms, residual.rms_validation) == (
        pytest.approx(errors.rms),
        pytest.approx(errors.rms_validation),
    )
    floors = [step.noise_floor for step in diagnosed_demo.steps]
    assert len(floors) > 1
    for floor in (*floors, errors.noise_floor):
        assert floor == pytest.approx(residual.noise_floor)  # one per set
    own = result.residuals[demo.fit_groups[0].name]
    assert own.noise is not None and own.residual.shape[1] == len(own.noise)
    if "observer" in options:
        assert result.noise_in("t1p1") != pytest.approx(residual.noise_floor, rel=0.1)


def test_no_staircase_rises_where_the_error_falls(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    steps, spread = diagnosed_demo.steps, demo.torque_spread
    chart = staircase_chart(steps, 1, "joint2", spread=spread)
    (noise,) = [line for line in chart.series if line.label == "noise"]
    assert len(set(noise.y)) == 1  # one line for all models
    for line in chart.series:
        assert chart.y.unit == "% of the torque" and np.all(np.diff(line.y) <= 0)
    for joint in range(2):
        shares = [stated_errors(step, spread).of(joint) for step in steps]
        torques = [JointErrors(step.rms_validation or (), ()).of(joint) for step in steps]
        assert np.all(np.sign(np.diff(shares)) == np.sign(np.diff(torques)))
