"""Charts of fits: convergence and bandwidth sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, DASHED, DASHES, Chart, ChartAxis, ChartSeries, no_chart
from flexviz.identification import SweepResult
from flexviz.progress import Iteration
from flexviz.wording import SYMBOLS, escape, number

Array = NDArray[np.float64]

# -- convergence -----------------------------------------------------------------------------------------

MAX_PARAMETERS = 14  # drawn
CONVERGENCE_FLOOR = 1e-3  # smallest cost and step drawn on a logarithmic axis
FIRST_DRAWN = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")


def convergence_charts(iterations: Sequence[Iteration]) -> tuple[Chart, ...]:
    """Cost and step (logarithmic), and the parameters relative to their present values."""
    if not iterations:
        note = "Cost, step and parameters appear here, live, after Run (step 3, Identify)."
        return no_chart("cost", note), no_chart("step"), no_chart("parameters")
    count = max(len(iterations), 2)
    x = np.arange(1.0, count + 1.0)
    steps = [iteration.step for iteration in iterations]
    if len(steps) > 1 and steps[0] <= 0:
        steps[0] = steps[1]  # the start has no step
    costs = [iteration.cost for iteration in iterations]

    def falling(key: str, title: str, colour: str, values: Sequence[float]) -> Chart:
        known = np.nan_to_num(np.asarray(values, dtype=float), nan=0.0, posinf=0.0)
        y = np.resize(np.maximum(known, CONVERGENCE_FLOOR), count)
        return Chart(key, title, axis, ChartAxis(logarithmic=True), (ChartSeries(key, colour, x, y),))

    axis = ChartAxis("iteration")
    drawn = scaled_parameters(iterations, x)
    return (
        falling("cost", "Cost (weights change between iterations)", COLOURS.measured, costs),
        falling("step", "Step (relative; values below 0.001 are drawn at 0.001)", COLOURS.model, steps),
        Chart("parameters", "Parameters / present value", axis, ChartAxis(), drawn, height=260),
    )


def scaled_parameters(iterations: Sequence[Iteration], x: Array) -> tuple[ChartSeries, ...]:
    """Each parameter divided by its present value; stiffness and motor inertia first."""
    names = iterations[-1].names
    rows = [iteration.values for iteration in iterations if tuple(iteration.names) == tuple(names)]
    values = np.array(rows, dtype=float).reshape(len(rows), len(names))
    if len(values) < len(x):  # an earlier stage had other parameters
        values = np.concatenate((np.repeat(values[:1], len(x) - len(values), axis=0), values))
    now = values[-1]
    scale = np.where(np.abs(now) > 1e-9, np.abs(now), 1.0)
    shares = np.clip(np.nan_to_num(values / scale), -5.0, 5.0)
    chosen = sorted(range(len(names)), key=lambda i: (rank(names[i]), i))[:MAX_PARAMETERS]
    colours = len(COLOURS.series)
    drawn = []
    for k, i in enumerate(chosen):
        parameter, _, joint = names[i].partition(":")
        label = f"{SYMBOLS.get(parameter, parameter)} {joint}".strip()  # "K panda_joint1"
        colour, dash = COLOURS.series[k % colours], DASHES[k // colours]
        drawn.append(ChartSeries(label, colour, x, shares[:, i], dash=dash))
    return tuple(drawn)


def rank(name: str) -> int:
    """Position of a parameter in the legend, constant during a fit."""
    parameter = name.partition(":")[0]
    if parameter in FIRST_DRAWN:
        return FIRST_DRAWN.index(parameter)
    return len(FIRST_DRAWN) + ("." not in parameter)


def progress_text(iterations: Sequence[Iteration]) -> str:
    """One line about a running fit."""
    if not iterations:
        return "starting"
    last = iterations[-1]
    return f"iteration {len(iterations)} ({last.stage}): cost {last.cost:.4g}, step {last.step:.1e}"


# -- bandwidth sweep -------------------------------------------------------------------------------------

SWEEP_COUNT = 11  # bandwidths
SWEEP_FACTOR = 3.0  # between the present bandwidth and the ends of the sweep
SWEEP_HEIGHT = 170  # [px]
MIN_STIFFNESS_SPAN = 0.01  # of the stiffness axis, relative: smaller changes look constant
MAX_LINEAR_RATIO = 20.0  # of largest to smallest value on a linear axis
PREFIXES = ((1e10, 1e-9, "G"), (1e7, 1e-6, "M"), (1e4, 1e-3, "k"))  # lower limit, factor, prefix


def sweep_bandwidths(
    present: float, lowest: float, highest: float, count: int = SWEEP_COUNT
) -> tuple[float, ...]:
    """`count` bandwidths [rad/s] evenly spaced on a logarithmic scale around `present`, within the limits."""
    low, high = max(present / SWEEP_FACTOR, lowest), min(present * SWEEP_FACTOR, highest)
    return tuple(float(f"{w:.4g}") for w in np.geomspace(low, high, count))


def judged(result: SweepResult) -> Array:
    """(M, n) rms of the validation groups, else of the fitted ones [Nm]."""
    return result.rms_fit if np.isnan(result.rms_validation).any() else result.rms_validation


def sweep_charts(result: SweepResult, joint: int, name: str) -> tuple[Chart, ...]:
    """Residual and stiffness of one joint against bandwidth, with the residual's minimum marked."""
    order = np.argsort(result.bandwidths)
    w = result.bandwidths[order]
    fit, colour = result.rms_fit[order, joint], COLOURS.series[3]
    lines = [ChartSeries("fit", colour, w, fit, dash=DASHED, points=True)]
    if not np.isnan(result.rms_validation).any():
        held_out = result.rms_validation[order, joint]
        lines.append(ChartSeries("validation", COLOURS.residual, w, held_out, 2.0, points=True))
    low, high, logarithmic = stiffness_limits(result.stiffness[:, joint])
    factor, prefix = scaled(math.sqrt(low * high) if logarithmic else high)
    stiffness = factor * result.stiffness[order, joint]
    residual = Chart(
        "residual",
        f"Residual of {name}",
        ChartAxis("bandwidth", "rad/s", True, rounded(float(w[0]), float(w[-1]))),
        ChartAxis(unit="Nm"),
        tuple(lines),
        marker=float(w[np.argmin(judged(result)[order, joint])]),
        height=SWEEP_HEIGHT,
    )
    return residual, replace(
        residual,
        key="stiffness",
        title=f"Stiffness of {name}",
        y=ChartAxis("", f"{prefix}Nm/rad", logarithmic, (factor * low, factor * high)),
        series=(ChartSeries("identified", COLOURS.model, w, stiffness, 2.0, points=True),),
    )


def rounded(low: float, high: float) -> tuple[float, float]:
    """Axis limits around low and high (both positive); the lower one is a power of 2."""
    digit = 10.0 ** math.floor(math.log10(high))
    first, last = 2.0 ** math.floor(math.log2(low)), digit * math.ceil(high / digit)
    return first, max(last, 2.0 * first)


def stiffness_limits(values: Array) -> tuple[float, float, bool]:
    """Axis limits, at least `MIN_STIFFNESS_SPAN` apart, and whether the axis is logarithmic.

    A logarithmic axis is needed if the stiffness is at its bound for some of the bandwidths.
    """
    low, high = float(values.min()), float(values.max())
    if low > 0 and high > MAX_LINEAR_RATIO * low:
        return 10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high)), True
    middle = (low + high) / 2.0
    half = max(0.55 * (high - low), 0.5 * MIN_STIFFNESS_SPAN * abs(middle), 1e-9)
    return middle - half, middle + half, False


def scaled(largest: float) -> tuple[float, str]:
    """Factor and SI prefix that keep axis labels short."""
    return next(((f, p) for limit, f, p in PREFIXES if largest >= limit), (1.0, ""))


def sweep_html(result: SweepResult, joint: int, name: str) -> str:
    """The bandwidth of least residual, for this joint and over all joints."""
    errors = judged(result)
    kind = "fit" if errors is result.rms_fit else "validation"
    least = int(np.argmin(errors[:, joint]))
    text = (
        f"{escape(name)}: least {kind} residual {number(float(errors[least, joint]), 3)} Nm "
        f"at {number(float(result.bandwidths[least]), 3)} rad/s (vertical line)."
    )
    if errors.shape[1] > 1:
        text += f" All joints together: {number(result.best, 3)} rad/s."
    if len(errors) > 1 and result.best in (result.bandwidths.min(), result.bandwidths.max()):
        text += " That is the end of the sweep's range: use it and sweep again."
    return f'<div class="fv">{text}</div>'
