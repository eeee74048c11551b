"""Plots as data: thinning that keeps extremes, no NaN, playheads, what the observer's slider shows."""

from __future__ import annotations

import io
import time
import zipfile
from argparse import Namespace
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexviz.content.charts import (
    COLOURS,
    Chart,
    ChartAxis,
    ChartSeries,
    Ribbon,
    chart_csv,
    charts_zip,
    no_chart,
)
from flexviz.content.charts.chart import MAX_POINTS, TIME, finite, thin, time_chart
from flexviz.content.records import JointErrors
from flexviz.content.scene.motion import RobotMotion, measured_motion, nice_factor, scene_labels, with_replay
from flexviz.content.view import BeforeAfter, numbers_html, shape_charts, signals_charts, states_charts
from flexviz.content.view.fit_charts import convergence_charts, falling_cost, progress_text, solver_stages
from flexviz.content.view.time_charts import observer_for, stretch
from flexviz.content.wording import number
from flexviz.data.measurements import Group, MeasurementSet, Segment, read_set
from flexviz.model.observers import OBSERVERS, make_observer
from flexviz.outlets.app.uplot import _scales, columns, nearest
from tests.small_set import write_small_set


@pytest.fixture(scope="module")
def measurements(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return read_set(write_small_set(tmp_path_factory.mktemp("view") / "small"))


@settings(deadline=None)
@given(st.integers(1, 5000), st.integers(0, 10))
def test_thinning_keeps_extremes_and_order(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = np.arange(count, dtype=float), rng.normal(size=count)
    thinned, (column,) = thin(x, [y])
    assert len(thinned) == len(column) <= MAX_POINTS
    assert np.all(np.diff(thinned) >= 0) and thinned[0] == x[0]
    assert column.max() == y.max() and column.min() == y.min()


def test_no_nan_reaches_a_chart() -> None:
    y = np.array([np.nan, 1.0, np.inf, -np.inf, np.nan, 2.0])
    assert finite(y).tolist() == [0.0, 1.0, 1.0, 1.0, 1.0, 2.0]
    chart = time_chart("k", "t", "Nm", np.arange(6.0), [("a", "#000000", y)])
    assert all(np.isfinite(column).all() for column in columns(chart))


def test_playhead_is_at_the_nearest_sample() -> None:
    x = np.array([0.0, 1.0, 3.0])
    assert nearest(x, 1.9) == 1
    assert nearest(x, 99.0) == 2
    assert nearest(np.zeros(0), 1.0) == 0


@pytest.mark.parametrize("name", list(OBSERVERS))
def test_states_follow_the_bandwidth(measurements: MeasurementSet, name: str) -> None:
    group = measurements.groups[0]
    shown = {}
    for bandwidth in (20.0, 80.0):
        plots = states_charts(group, 1, make_observer(name, bandwidth), measurements.torque_hold)
        assert [p.key for p in plots] == [
            "theta",
            "theta1",
            "theta2",
            "theta3",
            "theta4",
            "tau",
            "disturbance",
        ]
        for chart in plots:
            drawn = columns(chart) if chart.series else (np.zeros(0),)
            assert len(drawn[0]) <= MAX_POINTS and all(len(column) == len(drawn[0]) for column in drawn)
            assert all(np.isfinite(column).all() for column in drawn)
        shown[bandwidth] = plots
    assert not np.array_equal(shown[20.0][4].series[0].y, shown[80.0][4].series[0].y)
    assert bool(shown[20.0][6].series) == make_observer(name).has_disturbance_state


def test_one_joint_is_the_same_as_all(measurements: MeasurementSet) -> None:
    group, observer = measurements.groups[1], make_observer("eso", 60.0)
    alone = states_charts(group, 1, observer)[0].series[1].y
    states = observer.states(group.segments[0])
    _, (together,) = thin(states.time, [states.theta[0, :, 1]])
    assert alone == pytest.approx(together)


def test_a_bandwidth_for_each_joint() -> None:
    assert observer_for("eso", (20.0, 70.0), 1).bandwidth == 70.0
    assert observer_for("eso", None, 1).bandwidth == make_observer("eso").bandwidth


@pytest.mark.parametrize("name", list(OBSERVERS))
def test_numbers_say_lag_and_noise(name: str) -> None:
    observer = make_observer(name, 50.0)
    gain = observer.noise_gain(0.001)
    assert gain.shape == (5,) and np.all(np.diff(np.log(gain)) > 0)
    assert (abs(observer.lag(0.001)) < 1e-6) == observer.zero_phase
    text = numbers_html(observer, 0.001)
    assert "Lag" in text and all(f"<td>{number(value, 2)}</td>" in text for value in gain)


def test_bandwidth_to_plot_data_in_time(tmp_path: Any) -> None:
    """20 s × 1 kHz × 7 joints, one joint shown; the promise is 50 ms, here with slack for a busy machine."""
    t = np.arange(20000) * 0.001
    theta = np.sin(np.outer(t, np.arange(1, 8)))
    segment = Segment(t, theta, 5 * theta, 0.001)
    group = Group("g", "t", "p", (), False, tmp_path, (segment,), t)
    states_charts(group, 3, make_observer("eso", 50.0))
    taken = []
    for bandwidth in np.linspace(20, 200, 15):
        begin = time.perf_counter()
        states_charts(group, 3, make_observer("butterworth-zero-phase", float(bandwidth)))
        taken.append(time.perf_counter() - begin)
    assert np.median(taken) < 0.15


# -- results, as far as plots use them -------------------------------------------------------------------


@dataclass
class Series:
    time: np.ndarray
    residual: np.ndarray
    torque: np.ndarray
    q: np.ndarray


@dataclass
class Model:
    stiffness: np.ndarray


@dataclass
class Result:
    residuals: dict[str, Series]
    parameters: tuple[Any, ...] = ()
    model: Model = field(default_factory=lambda: Model(np.array([2000.0, 1500.0])))


def result_for(measurements: MeasurementSet) -> Any:
    segment = measurements.groups[0].segments[0]
    every = slice(None, None, 10)
    time_, tau = segment.time[every], segment.tau[every]
    residual = 0.1 * np.ones_like(tau)
    q = segment.theta[every] - tau / np.array([2000.0, 1500.0])
    return Result({"g1": Series(time_, residual, tau, q)})


def test_signals_before_and_after(measurements: MeasurementSet) -> None:
    group = measurements.groups[0]
    before = signals_charts(group, 0, "joint1", BeforeAfter(None), None)
    assert [bool(p.series) for p in before] == [True, False, False] and "Run" in before[1].note
    result = result_for(measurements)
    motion = measured_motion(measurements, group, result)
    after = signals_charts(group, 0, "joint1", BeforeAfter(result), motion)
    torque, residual, _ = after
    assert [series.label for series in torque.series] == ["measured", "model"]
    assert np.abs(torque.series[0].y - torque.series[1].y).max() < 1.0
    assert residual.series[0].y == pytest.approx(0.1)


def scaled(result: Any, factor: float) -> Any:
    """The result with other residuals."""
    series = {name: replace(one, residual=factor * one.residual) for name, one in result.residuals.items()}
    return replace(result, residuals=series)


def test_before_and_after_are_on_one_axis(measurements: MeasurementSet) -> None:
    group, first = measurements.groups[0], result_for(measurements)
    half, tiny = scaled(first, 0.5), scaled(first, 1e-4)

    def drawn(fits: BeforeAfter) -> Chart:
        return signals_charts(group, 0, "joint1", fits, None)[1]

    # the first model's axis stays, in Nm, for whatever comes after it; the one before is grey
    for present, before in ((first, None), (half, first), (tiny, half)):
        chart = drawn(BeforeAfter(present, before, first=first))
        assert chart.y.limits == pytest.approx((-0.105, 0.105)) and chart.heading == "Residual, joint1 [Nm]"
        *grey, now = chart.series
        assert now.colour == COLOURS.residual
        assert now.y == pytest.approx(present.residuals["g1"].residual[0, 0])
        assert [line.colour for line in grey] == [COLOURS.reference] * (before is not None)
        if before is not None:
            assert grey[0].label == "before" and len(grey[0].x) == len(now.x)
            assert grey[0].y == pytest.approx(before.residuals["g1"].residual[0, 0])
        assert all(np.isfinite(column).all() for column in columns(chart))
    # zoomed it is the present one's, still in Nm; one that is larger than the first is not cut
    zoomed = drawn(BeforeAfter(tiny, first, first=first, zoomed=True))
    assert zoomed.y.limits == pytest.approx((-1.05e-5, 1.05e-5)) and zoomed.y.unit == "Nm"
    assert [line.colour for line in zoomed.series] == [COLOURS.residual]
    assert drawn(BeforeAfter(first, half, "model 1", first=tiny)).y.limits == pytest.approx((-0.105, 0.105))
    # of a group that only the present model has
    other = replace(first, residuals={})
    assert len(drawn(BeforeAfter(first, other, first=other)).series) == 1


def test_deflection_from_the_best_source(measurements: MeasurementSet) -> None:
    group = measurements.groups[0]
    rough = measured_motion(measurements, group, None)
    assert "rough" in rough.deflection_source and rough.deflection is not None
    found = measured_motion(measurements, group, result_for(measurements))
    assert "identified" in found.deflection_source and found.deflection is not None
    truth = group.segments[0].tau[:, 0] / 2000.0
    at = np.interp(found.time, group.segments[0].time, truth)
    assert np.abs(found.deflection[:, 0] - at).max() < 2e-3


def test_the_deflection_is_drawn_where_the_stiffness_is_determined(measurements: MeasurementSet) -> None:
    group, (first, second) = measurements.groups[0], measurements.joints

    def of(grade: str, at_bound: bool = False) -> RobotMotion:
        one = SimpleNamespace(name="stiffness", joint=first, identifiable="yes", at_bound=False)
        other = SimpleNamespace(name="stiffness", joint=second, identifiable=grade, at_bound=at_bound)
        result = replace(result_for(measurements), parameters=(one, other))
        return measured_motion(measurements, group, result)

    assert of("weak").determined is not None and of("weak").determined.tolist() == [True, True]  # type: ignore[union-attr]
    for motion in (of("no"), of("yes", at_bound=True)):
        assert motion.determined is not None and motion.determined.tolist() == [True, False]
        straight, bent = motion.pose(1.0)[0], motion.pose(1.0, deflection=50.0)[0]
        assert straight[0] != bent[0] and straight[1] == bent[1]
    # before Run nothing is determined, nothing is drawn, and no factor is chosen
    rough = measured_motion(measurements, group, None)
    assert nice_factor(rough) is None
    assert np.array_equal(rough.pose(1.0, deflection=50.0)[0], rough.pose(1.0)[0])
    assert "deflection not drawn: K is not determined" in scene_labels(rough, 50.0, 1.0)[0]


def test_motion_exaggerates_deflection_and_error() -> None:
    t = np.array([0.0, 1.0])
    motion = RobotMotion("g", t, np.array([[0.0], [1.0]]), np.array([[0.1], [0.1]]), "link encoders")
    measured, model = motion.pose(0.5, deflection=10.0)
    assert measured == pytest.approx([-0.5]) and model == pytest.approx([0.5])

    class Run:
        time, theta, q, note = t, np.array([[0.0], [1.2]]), np.array([[0.0], [1.15]]), "closed loop"

    both = with_replay(motion, Run())
    _, model = both.pose(1.0, deflection=2.0, error=10.0)
    assert model == pytest.approx([1.0 + 10 * 0.2 - 2 * 0.05])
    assert nice_factor(motion) == 2
    texts = scene_labels(both, 2.0, 10.0)
    assert "deflection ×2" in texts[0] and "error ×10" in texts[1]
    assert "not identified" in scene_labels(motion, 2.0, 1.0)[1]
    assert "simulated data" in scene_labels(motion, 2.0, 1.0, simulated_data=True)[0]


def test_sample_clips_to_the_ends() -> None:
    values = np.array([[1.0], [3.0]])
    motion = RobotMotion("g1", np.array([0.0, 2.0]), values, None, "unknown")
    got = [float(motion.at(values, at)[0]) for at in (-1.0, 0.5, 9.0)]
    assert got == [1.0, 1.5, 3.0]


@dataclass
class Iteration:
    number: int
    stage: str
    cost: float
    step: float
    values: tuple[float, ...]
    names: tuple[str, ...]


def test_convergence_is_positive_scaled_and_finite() -> None:
    assert all(not chart.series for chart in convergence_charts([]))
    steps: list[Any] = [
        Iteration(i, "fit", 10.0**-i, 0.0 if i == 2 else 0.1, (900 + i, 0.0), ("stiffness:j", "x:j"))
        for i in range(3)
    ]
    for count in (1, 3):
        _, cost, parameters = convergence_charts(steps[:count])
        for chart in (cost, parameters):
            assert all(np.isfinite(column).all() for column in columns(chart))
        assert cost.y.logarithmic and cost.series[0].y.min() > 0
        assert parameters.series[0].label == "K j" and parameters.series[0].y[-1] == 1.0
    assert "iteration 3" in progress_text(steps)
    # the final interval: 902 ± 1.96 · 92 in units of 902; the other has no relative one
    known: Any = [SimpleNamespace(label="stiffness:j", std=92.0), SimpleNamespace(label="x:j", std=1.0)]
    result: Any = SimpleNamespace(parameters=known)
    assert "come from the diagnosis" in convergence_charts([], result=result)[0].note
    (band,) = convergence_charts(steps, result=result)[2].ribbons
    assert band.high == pytest.approx(np.full(3, 1 + 1.96 * 92 / 902))
    assert band.low == pytest.approx(2 - band.high)


def test_the_cost_falls_although_its_weights_change() -> None:
    costs = (1204.0, 404.0, 403.0, 853.0, 769.0, 1251.0, 1192.0)
    names = ("fit", "fit", "fit", "fit", "fit", "again", "again")
    steps: list[Any] = [
        Iteration(i, name, cost, 0.1, (1.0,), ("stiffness:j",))
        for i, (name, cost) in enumerate(zip(names, costs, strict=True))
    ]
    assert solver_stages(steps) == [("fit", 0, 2), ("fit, new weights", 3, 4), ("again", 5, 6)]
    fall = falling_cost(steps)
    assert fall[0] == 1.0 and np.all(np.diff(fall) <= 0.0)
    assert fall[-1] == pytest.approx(403 / 1204 * 769 / 853 * 1192 / 1251)
    error, cost, _ = convergence_charts(
        steps, [JointErrors((rms,), (4.0,), (0.1,)) for rms in (8.0, 0.8, 0.7, 0.65)]
    )
    assert error.y.unit == "% of the torque"
    assert [stage.name for stage in cost.stages] == ["1. fit", "2. fit, new weights", "3. again"]
    x, line, floor, *bands = columns(error)
    assert (
        line[0] == pytest.approx(200.0)
        and line[2] == pytest.approx(20.0)
        and line[-1] == pytest.approx(16.25)
        and set(floor) == {2.5}
    )
    for stage, band in zip(cost.stages, bands, strict=True):  # as wide as its iterations, none overlaps
        assert x[band == 1.0].min() == stage.first and x[band == 1.0].max() == stage.last
    assert np.array_equal(np.sum(bands, axis=0), np.ones(len(x)))


def test_small_values_are_shown_in_thousandths() -> None:
    for scale, unit in ((1.0, "Nm"), (1e-2, "mNm"), (1e-6, "µNm"), (0.0, "Nm")):
        chart = time_chart(
            "k", "t", "Nm", np.arange(3.0), [("a", "#000000", scale * np.array([0.0, 1.0, 0.5]))]
        )
        assert chart.heading == f"t [{unit}]"
        assert not scale or 0.1 <= chart.series[0].y.max() < 100


def test_of_a_long_recording_a_stretch_is_filtered(measurements: MeasurementSet) -> None:
    segment = measurements.groups[0].segments[0]
    whole, nothing = stretch([segment], 0.0)
    assert whole == [segment] and nothing == ""
    (part,), note = stretch([segment], 2.0, longest=500)
    assert len(part) == 500 and part.time[0] < 2.0 < part.time[-1] and "long recording" in note
    (end,), _ = stretch([segment], 1e9, longest=500)
    assert end.time[-1] == segment.time[-1]


def test_torque_over_angle_and_its_spectrum(measurements: MeasurementSet) -> None:
    group = measurements.groups[0]
    phase, _ = shape_charts(group, 0, "joint1", None)
    segment = max(group.segments, key=len)
    (points,) = phase.series
    assert points.points and points.width == 0.0 and np.all(np.diff(points.x) >= 0)
    nearest = [
        np.argmin(np.hypot(segment.theta[:, 0] - x, segment.tau[:, 0] - y))
        for x, y in zip(points.x[::50], points.y[::50], strict=True)
    ]
    assert np.allclose(segment.tau[nearest, 0], points.y[::50], atol=0.02 * np.ptp(segment.tau[:, 0]))
    # a sine of known frequency and amplitude: the peak stands there and holds its power
    time = np.arange(0.0, 20.0, 0.005)
    tau = np.zeros((len(time), 1))
    tau[:, 0] = 3.0 * np.sin(2 * np.pi * 4.0 * time)
    sine: Any = Namespace(segments=[replace(segment, time=time, theta=tau / 10, tau=tau)], name="g")
    spectrum = shape_charts(sine, 0, "joint1", None)[1]
    (line,) = spectrum.series
    assert spectrum.y.unit == "mNm/√Hz" and line.y.min() >= 1e-3  # an axis writes no smaller values
    assert line.x[np.argmax(line.y)] == pytest.approx(4.0, abs=0.2)
    assert np.sqrt(np.trapezoid(line.y**2, line.x)) == pytest.approx(3e3 / np.sqrt(2), rel=0.05)
    strong: Any = Namespace(segments=[replace(sine.segments[0], tau=2e3 * tau)], name="g")  # of a large robot
    (line,) = shape_charts(strong, 0, "joint1", None)[1].series
    assert shape_charts(strong, 0, "joint1", None)[1].y.unit == "Nm/√Hz"
    assert line.y.min() >= 1e-3 and np.sqrt(np.trapezoid(line.y**2, line.x)) == pytest.approx(
        6e3 / np.sqrt(2), rel=0.05
    )


def test_the_longest_segment_may_have_no_residual(measurements: MeasurementSet) -> None:
    group = measurements.groups[0]
    late = Namespace(time=group.segments[0].time + 100.0, residual=group.segments[0].tau)
    result: Any = Namespace(residuals={group.name: late})
    phase, spectrum = shape_charts(group, 0, "joint1", result)
    assert [line.label for line in (*phase.series, *spectrum.series)] == ["measured", "measured"]


def test_plots_are_saved_as_pictures_and_tables() -> None:
    x = np.arange(3.0)
    line = ChartSeries("torque", "#0072B2", x, np.array([0.5, -1.25, 2.0]))
    chart = Chart(
        "k",
        "Torque, joint 1",
        y=ChartAxis(unit="Nm"),
        series=(line,),
        ribbons=(Ribbon("noise", "#777777", x, -x, x),),
    )
    assert chart_csv(chart).splitlines()[:2] == [
        'time [s],torque [Nm],"noise, low [Nm]","noise, high [Nm]"',
        "0,0.5,-0,0",
    ]
    with zipfile.ZipFile(io.BytesIO(charts_zip([no_chart("empty"), chart]))) as file:
        assert file.namelist() == ["1-torque-joint-1.svg", "1-torque-joint-1.csv"]
        assert ElementTree.fromstring(file.read("1-torque-joint-1.svg")).tag.endswith("svg")


def test_the_range_of_a_chart_over_other_than_time_is_that_of_its_data() -> None:
    """Viser keeps the range that a chart showed before it was built anew: another joint's data were cut."""

    def range_of(axis: ChartAxis, *ends: float) -> Any:
        series = ChartSeries("torque", "#000", np.array(ends), np.zeros(len(ends)))
        chart = Chart("key", "title", axis, series=(series,))
        return _scales(chart, columns(chart)[0])["x"].get("range")

    angle = ChartAxis("position", "rad")
    assert range_of(angle, -1.9, 0.4) == (-1.9, 0.4) and range_of(angle, -0.6, 1.4) == (-0.6, 1.4)
    assert range_of(replace(angle, limits=(0.0, 1.0)), -1.9, 0.4) == (0.0, 1.0)
    # a zoom is kept while these grow or are played
    for axis in (TIME, ChartAxis("iteration", whole=True), ChartAxis("frequency", "Hz", logarithmic=True)):
        assert range_of(axis, 1.0, 2.0) is None
