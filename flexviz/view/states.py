"""The observer's states of one joint in one group: what the bandwidth slider moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.measurements import Group, Segment
from flexviz.observers import Observer, make_observer
from flexviz.view.colours import MEASURED, MODEL
from flexviz.view.plots import Line, Plot, no_plot, thin
from flexviz.view.text import number

Array = NDArray[np.float64]

HEIGHT = 150  # [pixels]
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


def states_plots(group: Group, joint: int, observer: Observer, torque_hold: float = 0.0) -> tuple[Plot, ...]:
    """θ … its 4th derivative, τ and the disturbance of one joint, one plot each."""
    times: list[Array] = []
    columns: list[list[Array]] = [[] for _ in range(9)]
    disturbance = True
    for segment in group.segments:
        states = observer.states(one_joint(segment, joint), torque_hold)
        times.append(states.time)
        for k in range(5):
            columns[k].append(states.theta[k, :, 0])
        columns[5].append(states.tau[0, :, 0])
        columns[6].append(segment.theta[:, joint])
        columns[7].append(segment.tau[:, joint])
        if states.disturbance is None:
            disturbance = False
        else:
            columns[8].append(states.disturbance[:, 0])
    time = np.concatenate(times)
    valid = np.concatenate([observer.valid(t) for t in times])
    joined = [np.concatenate(parts) if parts else np.zeros(len(time)) for parts in columns]
    x, thinned = thin(time, joined)
    inside, note = settled(x, time[valid])
    plots = []
    for k, (key, title) in enumerate(zip(KEYS, ORDERS, strict=True)):
        if k == 0:
            lines = (Line("measured", MEASURED, thinned[6], 2.6), Line("observer", MODEL, thinned[0], 1.3))
            plots.append(Plot(key, title, x, lines, height=HEIGHT, note=note))
        else:
            plots.append(
                Plot(key, title, x[inside], (Line("observer", MODEL, thinned[k][inside]),), height=HEIGHT)
            )
    lines = (Line("measured", MEASURED, thinned[7], 2.6), Line("observer", MODEL, thinned[5], 1.3))
    plots.append(Plot("tau", "τ [Nm]", x, lines, height=HEIGHT))
    if disturbance:
        lines = (Line("observer", MODEL, thinned[8][inside]),)
        plots.append(Plot("disturbance", "disturbance [rad/s⁵]", x[inside], lines, height=HEIGHT))
    else:
        plots.append(no_plot("disturbance", "This observer has no disturbance state; the ESO has one."))
    return tuple(plots)


def settled(x: Array, valid: Array) -> tuple[NDArray[np.bool_], str]:
    """Which instants x lie outside the start-up and end transients, and a sentence about what is left out."""
    if not len(valid):
        return np.ones(len(x), bool), "At this bandwidth the whole recording is start-up transient."
    inside = (x >= valid[0]) & (x <= valid[-1])
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
