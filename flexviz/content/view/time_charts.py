"""Charts over time of one joint: torque and residual, the observer's states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.analysis.identification import Identification
from flexviz.base.arrays import Array, Bools
from flexviz.content.charts import COLOURS, Chart, ChartAxis, ChartSeries, no_chart, thin, time_chart
from flexviz.content.scene import RobotMotion
from flexviz.content.view.residual_time import BeforeAfter, over_time, residual_chart
from flexviz.content.view.residuals import left_out
from flexviz.content.wording import TORQUE_SIGNAL, DrivingSignal, number
from flexviz.data.measurements import Group, Segment
from flexviz.model.observers import EsoGains, Observer, make_observer

SIGNAL_HEIGHT, STATE_HEIGHT = 200, 150  # [px]
MAX_FILTERED = 100_000  # samples filtered for a chart
THETA_STATES = (
    ("theta", "θ", "rad"),
    ("theta1", "θ̇", "rad/s"),
    ("theta2", "θ̈", "rad/s²"),
    ("theta3", "θ⃛", "rad/s³"),
    ("theta4", "θ⁗", "rad/s⁴"),
)  # key, title, unit


def torque(group: Group, joint: int) -> tuple[Array, Array]:
    """Time (N,) [s] and measured torque (N,) [Nm] of one joint over all segments."""
    return group.joined("time"), group.joined("tau")[:, joint]


def model_torque(
    group: Group, joint: int, result: Identification | None
) -> tuple[Array, Array, Array] | None:
    """Time [s], model torque and residual [Nm] of one joint, (M,) each; None without a residual.

    The model torque is the measured torque minus the residual.
    """
    found = over_time(result, group.name, joint)
    if found is None:
        return None
    time, residual = found
    return time, np.interp(time, *torque(group, joint)) - residual, residual


def signals_charts(
    group: Group,
    joint: int,
    name: str,
    fits: BeforeAfter,
    motion: RobotMotion | None,
    span: tuple[float, float] | None = None,
) -> tuple[Chart, ...]:
    """What drives one joint, residual and motor-angle error, in a span of time [s].

    Of joints that follow goals the residual is the motor-angle error, which is drawn once.
    """
    time, recorded = torque(group, joint)
    result, signal = fits.present, fits.signal
    first, last = span or (float(time[0]), float(time[-1]))
    time, recorded = within((first, last), time, recorded)
    lines = [("measured", COLOURS.measured, recorded)]
    model = model_torque(group, joint, result)
    if model is None:
        why = f"{signal.waiting} here after Run (step 3, Identify)."
        second = no_chart("residual", why if result is None else left_out(group.name))
        shown = time
    else:
        model_time, explained, _ = within((first, last), *model)
        inside = (time >= model_time[0]) & (time <= model_time[-1])
        shown = time[inside]
        modelled = np.interp(shown, model_time, explained)
        lines = [("measured", COLOURS.measured, recorded[inside]), ("model", COLOURS.model, modelled)]
        second = signal_residual(group, joint, name, fits, (first, last))
    upper = time_chart("torque", f"{signal.title}, {name}", signal.unit, shown, lines, height=SIGNAL_HEIGHT)
    charts = [upper, second]
    if signal is TORQUE_SIGNAL:
        charts.append(_error_chart(joint, name, motion, (first, last)))
    return tuple(chart.spans(first, last) for chart in charts)


def signal_residual(
    group: Group,
    joint: int,
    name: str,
    fits: BeforeAfter,
    span: tuple[float, float],
) -> Chart:
    """The residual of one joint in a span of time [s]."""
    drawn = residual_chart(fits, joint, group.name, f"{fits.signal.residual}, {name}", span)
    return no_chart("residual") if drawn is None else replace(drawn, height=SIGNAL_HEIGHT)


def within(span: tuple[float, float] | None, time: Array, *columns: Array) -> tuple[Array, ...]:
    """Time (N,) [s] and columns (N,) in a span; all of them if it holds fewer than two samples."""
    inside = np.ones(len(time), bool) if span is None else (time >= span[0]) & (time <= span[1])
    rows = inside if np.count_nonzero(inside) > 1 else slice(None)
    return time[rows], *(column[rows] for column in columns)


def _error_chart(joint: int, name: str, motion: RobotMotion | None, span: tuple[float, float]) -> Chart:
    if motion is None or motion.model_theta is None:
        return no_chart("error")
    error = motion.model_theta[:, joint] - motion.theta[:, joint]
    time, error = within(span, motion.time, error)
    x, (drawn,) = thin(time, [1e3 * error])
    line = ChartSeries("error", COLOURS.model, x, drawn)
    axis = ChartAxis(unit="mrad")  # of every model, however small its error
    title = f"Simulated − measured θ, {name}"
    return Chart("error", title, y=axis, series=(line,), playhead=True, height=SIGNAL_HEIGHT)


def one_joint(segment: Segment, joint: int) -> Segment:
    """The segment with the columns of one joint only, to filter no others."""
    columns = slice(joint, joint + 1)
    return replace(segment, theta=segment.theta[:, columns], tau=segment.tau[:, columns])


def observer_for(
    name: str, bandwidth: float | Sequence[float] | None, joint: int, gains: EsoGains | None = None
) -> Observer:
    """The observer of one joint, with the joint's bandwidth if there is one per joint."""
    own = bandwidth if bandwidth is None or np.ndim(bandwidth) == 0 else np.asarray(bandwidth)[joint]
    return make_observer(name, None if own is None else float(own), gains)  # type: ignore[arg-type]


def states_charts(
    group: Group,
    joint: int,
    observer: Observer,
    torque_hold: float = 0.0,
    at: float = 0.0,
    span: tuple[float, float] | None = None,
    signal: DrivingSignal = TORQUE_SIGNAL,
) -> tuple[Chart, ...]:
    """One chart each for θ and its derivatives up to the 4th, τ and the disturbance of one joint.

    Only the part of a long recording around `at` [s] is computed, to keep the slider responsive.
    """
    segments, cut = stretch(group.segments, at)
    time, valid, columns = estimate(segments, joint, observer, torque_hold)
    recorded = (measured(segments, joint, name) for name in ("theta", "tau"))
    shown_time, *shown_columns = within(span, time, *columns, *recorded)
    x, thinned = thin(shown_time, shown_columns)
    inside, note = settled(x, time[valid])

    def state(key: str, title: str, unit: str, column: int, recorded: int | None = None) -> Chart:
        rows = inside if recorded is None else slice(None)
        shown = ChartSeries("observer", COLOURS.model, x[rows], thinned[column][rows])
        series: tuple[ChartSeries, ...] = (shown,)
        if recorded is not None:
            below = ChartSeries("measured", COLOURS.measured, x, thinned[recorded], 2.6)
            series = (below, replace(shown, width=1.3))
        return Chart(key, title, y=ChartAxis(unit=unit), series=series, height=STATE_HEIGHT)

    charts = [
        state(*which, column, recorded=None if column else -2) for column, which in enumerate(THETA_STATES)
    ]
    charts[0] = replace(charts[0], note=f"{cut}{note}")
    charts.append(state("tau", signal.symbol, signal.unit, 5, recorded=-1))
    if len(columns) > 6:
        charts.append(state("disturbance", "disturbance", "rad/s⁵", 6))
    else:
        charts.append(no_chart("disturbance", "This observer has no disturbance state; the ESO has one."))
    return tuple(chart.spans(*(span or (x[0], x[-1]))) for chart in charts)


def estimate(
    segments: Sequence[Segment], joint: int, observer: Observer, torque_hold: float
) -> tuple[Array, Bools, list[Array]]:
    """Time, validity and θ … θ⁗, τ (and the disturbance, if estimated) of one joint, (N,) each."""
    parts: list[list[Array]] = []
    for segment in segments:
        states = observer.states(one_joint(segment, joint), torque_hold)
        row = [states.time, states.valid, *states.theta[:, :, 0], states.tau[0, :, 0]]
        parts.append(row if states.disturbance is None else [*row, states.disturbance[:, 0]])
    time, valid, *columns = (np.concatenate(pieces) for pieces in zip(*parts, strict=True))
    return time, valid.astype(bool), columns


def measured(segments: Sequence[Segment], joint: int, name: str) -> Array:
    """θ or τ of one joint over the segments, (N,)."""
    return np.concatenate([getattr(segment, name)[:, joint] for segment in segments])


def stretch(segments: Sequence[Segment], at: float, longest: int = MAX_FILTERED) -> tuple[list[Segment], str]:
    """The segments, or `longest` samples around `at` [s] of a long recording and a note on that."""
    if sum(len(segment) for segment in segments) <= longest:
        return list(segments), ""
    index = max((i for i, segment in enumerate(segments) if segment.time[0] <= at), default=0)
    segment = segments[index]
    first = int(np.clip(np.searchsorted(segment.time, at) - longest // 2, 0, max(len(segment) - longest, 0)))
    part = slice(first, first + longest)
    cut = replace(segment, time=segment.time[part], theta=segment.theta[part], tau=segment.tau[part])
    return [cut], f"A long recording: {cut.time[0]:.0f} to {cut.time[-1]:.0f} s are shown. "


def settled(x: Array, valid: Array) -> tuple[Bools, str]:
    """Mask of the instants x between the transients at both ends, and a note on the omitted ones."""
    inside = (x >= valid[0]) & (x <= valid[-1]) if len(valid) else np.zeros(len(x), bool)
    if np.count_nonzero(inside) < 2:
        return np.ones(len(x), bool), "At this bandwidth the whole recording is transient."
    start, end = max(float(valid[0] - x[0]), 0.0), max(float(x[-1] - valid[-1]), 0.0)
    if start + end < 1e-6:
        return inside, ""
    return (
        inside,
        f"Transients are omitted from the derivatives: {start:.2f} s at the start, {end:.2f} s at the end.",
    )


def numbers_html(observer: Observer, step: float) -> str:
    """Lag of slow motion and noise gain at a sampling step [s] as a small table."""
    if observer.zero_phase:
        note = "zero phase: forward and backward filtering, no delay"
    elif observer.name == "eso":
        note = "causal: each derivative lags differently, which biases stiffness and motor inertia"
    else:
        note = "equal delay: θ, τ and all derivatives lag alike"
    gains = "".join(f"<td>{number(value, 2)}</td>" for value in observer.noise_gain(step))
    return (
        f'<div class="fv"><b>Lag</b> {number(1000 * observer.lag(step), 3)} ms at 1 Hz '
        f'<span class="fv-dim">({note})</span>'
        '<table class="fv-table"><tr><th>Noise gain, derivative</th>'
        "<th>θ</th><th>1st</th><th>2nd</th><th>3rd</th><th>4th</th></tr>"
        f'<tr><td class="fv-dim">1/sᵏ</td>{gains}</tr></table></div>'
    )
