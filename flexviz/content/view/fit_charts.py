"""Charts of fits: convergence and bandwidth sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.analysis.identification import Identification, SweepResult
from flexviz.base.arrays import Array
from flexviz.base.iteration import Iteration
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import (
    COLOURS,
    DASHED,
    DASHES,
    Chart,
    ChartAxis,
    ChartSeries,
    Ribbon,
    ShadedStage,
    no_chart,
)
from flexviz.content.records import JointErrors
from flexviz.content.wording import SYMBOLS, escape, number

MAX_PARAMETERS = 14  # drawn
COST_SLACK = 1e-3  # relative rise of the cost that rounding and damping may cause within a stage
COST_FLOOR = 1e-9  # smallest relative cost drawn on a logarithmic axis
SMALL = 1e-9  # parameters below are drawn as they are, not relative to themselves
MAX_STAGES = 9  # named
FIRST_DRAWN = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")


def solver_stages(iterations: Sequence[Iteration]) -> list[tuple[str, int, int]]:
    """Name, first and last index of each stage; a cost that rises shows that the weights were renewed."""
    stages: list[tuple[str, int, int]] = []
    for k, iteration in enumerate(iterations):
        same = k > 0 and iteration.stage == iterations[k - 1].stage
        if same and iteration.cost <= iterations[k - 1].cost * (1.0 + COST_SLACK):
            stages[-1] = (*stages[-1][:2], k)
        else:
            stages.append((f"{iteration.stage}, new weights" if same else iteration.stage, k, k))
    return stages


def falling_cost(iterations: Sequence[Iteration]) -> Array:
    """Cost of each iteration relative to the start, continued where a stage changes what it is made of."""
    relative = np.ones(len(iterations))
    level = 1.0
    for _, first, last in solver_stages(iterations):
        costs = np.array([one.cost for one in iterations[first : last + 1]], dtype=float)
        usable = np.isfinite(costs) & (costs > 0)
        if usable[0]:
            relative[first : last + 1] = level * np.where(usable, costs, costs[0]) / costs[0]
        else:
            relative[first : last + 1] = level
        level = relative[last]
    return relative


def convergence_charts(
    iterations: Sequence[Iteration],
    ends: Sequence[JointErrors] = (),
    result: Identification | None = None,
    goals: bool = False,
) -> tuple[Chart, ...]:
    """Error at the end of each stage, relative cost, parameters relative to their present values.

    `ends` are the errors at the start and at the end of each stage; `result` is what the iterations led to,
    with the intervals of its parameters, or one without iterations, as of joints that follow `goals`.
    """
    if not iterations:
        note = "Error, cost and parameters appear here, live, after Run (step 3, Identify)."
        if result is not None and goals:
            note = (
                "The free motion of joints that follow goals is fitted in one go: there is no course to draw."
            )
        elif result is not None:
            note = f"The values of this model come from the diagnosis; Run fits them anew. {note}"
        return no_chart("error", note), no_chart("cost"), no_chart("parameters")
    count = max(len(iterations), 2)
    x, axis, found = np.arange(1.0, count + 1.0), ChartAxis("iteration"), solver_stages(iterations)
    falling = np.resize(np.maximum(falling_cost(iterations), COST_FLOOR), count)
    falling[len(iterations) :] = falling[len(iterations) - 1]
    cost = Chart(
        "cost",
        "Cost relative to the start, continued where the weights change",
        replace(axis, limits=(0.5, count + 0.5)),
        ChartAxis(logarithmic=True),
        (ChartSeries("cost", COLOURS.measured, x, falling, 2.0, steps=True),),
        stages=stage_bands(found, count),
        height=230,
    )
    error = no_chart("error")
    if len(ends) == 1 + len(found):
        spans = zip(found, ends[1:], strict=True)
        held = np.concatenate([np.full(last - first + 1, end.mean) for (_, first, last), end in spans])
        held = np.resize(held, count)
        held[0] = ends[0].mean
        lines = [ChartSeries("error", COLOURS.residual, x, held, 2.6, steps=True)]
        noise = ends[-1].mark
        if noise is not None and noise.mean > 0:
            low, look = np.full(count, noise.mean), (1.6, DASHES[2])
            lines.append(ChartSeries("noise", COLOURS.reference, x, low, *look, steps=True))
        error = replace(
            cost,
            key="error",
            title="Error at the start and after each stage",
            y=ChartAxis(unit=ends[0].unit, logarithmic=True),
            series=tuple(lines),
        )
    parameters = Chart(
        "parameters", "Parameters / present value", axis, series=scaled_parameters(iterations, x), height=260
    )
    if result is not None:
        title, bands = "Parameters / final value, bands ± 95 %", final_intervals(iterations[-1], result, x)
        parameters = replace(parameters, title=title, ribbons=bands)
    return error, cost, parameters


def stage_bands(stages: Sequence[tuple[str, int, int]], count: int) -> tuple[ShadedStage, ...]:
    """The solver's stages as shaded intervals of `count` iterations; many later ones together."""
    bands = tuple(
        ShadedStage(f"{k}. {name}", first + 0.5, (count if k == len(stages) else last + 1) + 0.5)
        for k, (name, first, last) in enumerate(stages, 1)
    )
    if len(bands) <= MAX_STAGES:
        return bands
    last = bands[MAX_STAGES - 1]
    return *bands[: MAX_STAGES - 1], ShadedStage("later stages", last.first, bands[-1].last)


def scaled_parameters(iterations: Sequence[Iteration], x: Array) -> tuple[ChartSeries, ...]:
    """Each parameter divided by its present value; stiffness and motor inertia first."""
    names = iterations[-1].names
    rows = [iteration.values for iteration in iterations if tuple(iteration.names) == tuple(names)]
    values = np.array(rows, dtype=float).reshape(len(rows), len(names))
    if len(values) < len(x):  # an earlier stage had other parameters
        values = np.concatenate((np.repeat(values[:1], len(x) - len(values), axis=0), values))
    now = values[-1]
    scale = np.where(np.abs(now) > SMALL, np.abs(now), 1.0)
    shares = np.clip(np.nan_to_num(values / scale), -5.0, 5.0)
    colours = len(COLOURS.series)
    drawn = []
    for k, i in enumerate(drawn_parameters(names)):
        parameter, _, joint = names[i].partition(":")
        label = f"{SYMBOLS.get(parameter, parameter)} {joint}".strip()  # "K panda_joint1"
        colour, dash = COLOURS.series[k % colours], DASHES[k // colours]
        drawn.append(ChartSeries(label, colour, x, shares[:, i], dash=dash))
    return tuple(drawn)


def drawn_parameters(names: Sequence[str]) -> list[int]:
    """Indexes of the parameters that are drawn, in the order of the legend."""
    return sorted(range(len(names)), key=lambda i: (rank(names[i]), i))[:MAX_PARAMETERS]


def final_intervals(last: Iteration, result: Identification, x: Array) -> tuple[Ribbon, ...]:
    """The 95 % interval of each drawn parameter relative to its final value, clipped to 0 … 2."""
    errors = {p.label: p.std for p in result.parameters}
    bands = []
    for k, i in enumerate(drawn_parameters(last.names)):
        value, std = abs(float(last.values[i])), errors.get(last.names[i], np.nan)
        if value > SMALL and np.isfinite(std):
            half = np.full(len(x), min(NORMAL_95 * std / value, 1.0))
            level = np.sign(float(last.values[i]))
            colour = COLOURS.series[k % len(COLOURS.series)]
            bands.append(Ribbon("", colour, x, level - half, level + half))
    return tuple(bands)


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
