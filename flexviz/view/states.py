"""The observer's states of one joint in one group: what the bandwidth slider moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, Line, Plot, aligned, no_plot, thin
from flexviz.measurements import Group, Segment
from flexviz.observers import Observer, make_observer
from flexviz.wording import number

Array = NDArray[np.float64]

HEIGHT = 150  # [pixels]
LONGEST = 100_000  # samples of a recording that are filtered for a plot
ORDERS = ("θ [rad]", "θ̇ [rad/s]", "θ̈ [rad/s²]", "θ⃛ [rad/s³]", "θ⁗ [rad/s⁴]")
KEYS = ("theta", "theta1", "theta2", "theta3", "theta4")


@dataclass(frozen=True, eq=False)
class ObserverNumbers:
    """How an observer treats a signal.

    Attributes
    ----------
    lag: delay of slow motion [s].
    noise_gain: (5,) from the noise of θ to the noise of each derivative [1, 1/s, … 1/s⁴].
    note: what else to know, one sentence.
    """

    lag: float
    noise_gain: Array
    note: str


def one_joint(segment: Segment, joint: int) -> Segment:
    """The segment with only one joint's columns, so that only this one is filtered."""
    columns = slice(joint, joint + 1)
    return replace(segment, theta=segment.theta[:, columns], tau=segment.tau[:, columns])


def observer_for(name: str, bandwidth: float | Sequence[float] | None, joint: int) -> Observer:
    """The observer as it treats one joint (its own bandwidth where there is one a joint)."""
    own = bandwidth if bandwidth is None or np.ndim(bandwidth) == 0 else np.asarray(bandwidth)[joint]
    return make_observer(name, None if own is None else float(own))  # type: ignore[arg-type]


def states_plots(
    group: Group, joint: int, observer: Observer, torque_hold: float = 0.0, at: float = 0.0
) -> tuple[Plot, ...]:
    """θ … its 4th derivative, τ and the disturbance of one joint, one plot each.

    Of a long recording only the stretch around `at` [s] is computed, so that the slider stays quick.
    """
    segments, cut = stretch(group.segments, at)
    time, valid, columns = estimate(segments, joint, observer, torque_hold)
    x, thinned = thin(time, [*columns, *(measured(segments, joint, name) for name in ("theta", "tau"))])
    inside, note = settled(x, time[valid])
    theta = (
        Line("measured", COLOURS.measured, thinned[-2], 2.6),
        Line("observer", COLOURS.model, thinned[0], 1.3),
    )
    tau = (
        Line("measured", COLOURS.measured, thinned[-1], 2.6),
        Line("observer", COLOURS.model, thinned[5], 1.3),
    )
    plots = [Plot(KEYS[0], ORDERS[0], x, theta, height=HEIGHT, note=f"{cut}{note}")]
    for k in range(1, 5):
        plots.append(_derivative(KEYS[k], ORDERS[k], x[inside], thinned[k][inside]))
    plots.append(Plot("tau", "τ [Nm]", x, tau, height=HEIGHT))
    if len(columns) > 6:
        plots.append(_derivative("disturbance", "disturbance [rad/s⁵]", x[inside], thinned[6][inside]))
    else:
        plots.append(no_plot("disturbance", "This observer has no disturbance state; the ESO has one."))
    return aligned(plots, x[0], x[-1])


def _derivative(key: str, title: str, x: Array, values: Array) -> Plot:
    return Plot(key, title, x, (Line("observer", COLOURS.model, values),), height=HEIGHT)


def estimate(
    segments: Sequence[Segment], joint: int, observer: Observer, torque_hold: float
) -> tuple[Array, NDArray[np.bool_], list[Array]]:
    """Time, validity and θ … θ⁗, τ (and the disturbance, where there is one) of one joint, each (N,)."""
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


def stretch(segments: Sequence[Segment], at: float, longest: int = LONGEST) -> tuple[list[Segment], str]:
    """The segments, or of a long recording `longest` samples around `at` [s], and a sentence about it."""
    if sum(len(segment) for segment in segments) <= longest:
        return list(segments), ""
    index = max((i for i, segment in enumerate(segments) if segment.time[0] <= at), default=0)
    segment = segments[index]
    first = int(np.clip(np.searchsorted(segment.time, at) - longest // 2, 0, max(len(segment) - longest, 0)))
    part = slice(first, first + longest)
    cut = replace(segment, time=segment.time[part], theta=segment.theta[part], tau=segment.tau[part])
    return [cut], f"A long recording: {cut.time[0]:.0f} to {cut.time[-1]:.0f} s are shown. "


def settled(x: Array, valid: Array) -> tuple[NDArray[np.bool_], str]:
    """Which instants x lie outside the start-up and end transients, and a sentence about what is left out."""
    inside = (x >= valid[0]) & (x <= valid[-1]) if len(valid) else np.zeros(len(x), bool)
    if np.count_nonzero(inside) < 2:
        return np.ones(len(x), bool), "At this bandwidth everything is start-up transient."
    start, end = float(valid[0] - x[0]), float(x[-1] - valid[-1])
    if start + end < 1e-6:
        return inside, ""
    return (
        inside,
        f"Derivatives leave out the transients: {start:.2f} s at the start, {end:.2f} s at the end.",
    )


def observer_numbers(observer: Observer, step: float) -> ObserverNumbers:
    """Lag and noise gain at a sampling step [s], with a sentence about them."""
    if observer.zero_phase:
        note = "zero phase: runs forward and backward, delays nothing"
    elif observer.name == "eso":
        note = "causal: each derivative lags differently, which biases stiffness and motor inertia"
    else:
        note = "equal delay: θ, τ and all derivatives lag alike"
    return ObserverNumbers(float(observer.lag(step)), np.asarray(observer.noise_gain(step)), note)


def numbers_html(numbers: ObserverNumbers) -> str:
    """Lag and noise gain as a small table."""
    gains = "".join(f"<td>{number(value, 2)}</td>" for value in numbers.noise_gain)
    return (
        f'<div class="fv"><b>Lag</b> {number(1000 * numbers.lag, 3)} ms at 1 Hz '
        f'<span class="fv-dim">({numbers.note})</span>'
        '<table class="fv-table"><tr><th>Noise gain, derivative</th>'
        "<th>θ</th><th>1st</th><th>2nd</th><th>3rd</th><th>4th</th></tr>"
        f'<tr><td class="fv-dim">1/sᵏ</td>{gains}</tr></table></div>'
    )
