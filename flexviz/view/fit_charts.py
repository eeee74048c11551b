"""Charts of fits: convergence, bandwidth sweep, and error after each added effect."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, DASHED, DASHES, Chart, ChartAxis, ChartSeries, no_chart
from flexviz.diagnosis import Step
from flexviz.identification import SweepResult
from flexviz.progress import Iteration
from flexviz.session import ModelStep
from flexviz.view.status import total_rms
from flexviz.wording import SYMBOLS, effect_text_name, escape, number

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


# -- error after each added effect -----------------------------------------------------------------------

NO_STEPS = (
    "The error of every group after each added effect appears here, with the noise floor: "
    "press Find the missing effect (step 4, Diagnose), then Add and refit."
)
COMPARED_IN = "rms residual in the band that the diagnosis compares models in, the same for every model"
HELD_OUT = "validation"
MAX_GROUPS = 10  # drawn
ERROR_FLOOR = 1e-6  # [Nm] smallest value drawn on a logarithmic axis


def step_errors(steps: Sequence[Step], joint: int | None) -> dict[str, tuple[list[float], bool]]:
    """Name -> (error at each step [Nm], held out?) of every group; fit and validation if groups are unknown.

    `joint` None: rms over the joints.
    """

    def value(row: Sequence[float]) -> float:
        values = np.asarray(row, dtype=float)
        return total_rms(values) if joint is None else float(values[joint])

    if all(step.groups for step in steps):
        names = [(name, held_out) for name, _, held_out in steps[-1].groups]
        found: dict[str, tuple[list[float], bool]] = {}
        for name, held_out in names[:MAX_GROUPS]:
            rows = [next((row for other, row, _ in step.groups if other == name), None) for step in steps]
            if all(row is not None for row in rows):
                found[name] = [value(row) for row in rows if row is not None], held_out
        return found
    found = {"fit": ([value(step.rms) for step in steps], False)}
    if all(step.rms_validation is not None for step in steps):
        found[HELD_OUT] = [value(step.rms_validation or ()) for step in steps], True
    return found


def staircase_charts(model_steps: Sequence[ModelStep], joint: int, name: str) -> tuple[Chart, ...]:
    """The error over all joints, and of the selected joint."""
    if not model_steps:
        return no_chart("all", NO_STEPS), no_chart("joint")
    steps = [model_step.step for model_step in model_steps]
    charts = [staircase_chart(steps)]
    if len(steps[0].rms) > 1:
        charts.append(staircase_chart(steps, joint, name))
    return tuple(charts)


def staircase_chart(
    steps: Sequence[Step], joint: int | None = None, name: str = "", ticks: Sequence[str] = ()
) -> Chart:
    """The error after each added effect, of one joint or over all (None); `ticks` name the steps."""
    x = np.arange(float(len(steps)))
    errors = step_errors(steps, joint)
    bright = COLOURS.series[:6]
    series = [
        ChartSeries(
            f"{group} (validation)" if held_out and group != HELD_OUT else group,
            bright[k % len(bright)],
            x,
            np.maximum(values, ERROR_FLOOR),
            2.6 if held_out else 1.6,
            DASHED if held_out else DASHES[0 if k < len(bright) else 3],
            points=len(steps) == 1,
            steps=True,
        )
        for k, (group, (values, held_out)) in enumerate(errors.items())
    ]
    floors = [np.asarray(step.noise_floor) for step in steps]
    if all(len(floor) for floor in floors):
        low = [total_rms(floor) if joint is None else float(floor[joint]) for floor in floors]
        if np.isfinite(low).all():
            floor = np.maximum(low, ERROR_FLOOR)
            series.append(ChartSeries("noise floor", COLOURS.reference, x, floor, 1.6, DASHES[2], steps=True))
    fell = (
        f"{group} from {number(values[0], 3)} to {number(values[-1], 3)} Nm"
        for group, (values, _) in errors.items()
    )
    whose = "of all joints" if joint is None else f"of {name}"
    return Chart(
        "all" if joint is None else "joint",
        f"Error after each added effect, {whose.removeprefix('of ')}",
        ChartAxis(
            "effects added",
            limits=(-0.5, len(steps) - 0.5),
            ticks=tuple(enumerate(ticks or [str(k) for k in range(len(steps))])),
            whole=True,
        ),
        ChartAxis("rms residual", "Nm", logarithmic=True),
        tuple(series),
        description=f"{'; '.join(fell)}.",
        height=230,
    )


def staircase_html(model_steps: Sequence[ModelStep]) -> str:
    """The errors of the steps as a table."""
    if not model_steps:
        return ""
    rows = []
    before: set[str] = set()
    for count, stair in enumerate(model_steps):
        added = [effect_text_name(name) for name in stair.effects if name not in before]
        before |= set(stair.effects)
        what = ", ".join(added) or "the model itself"
        held_out = stair.step.rms_validation
        rows.append(
            f"<tr><td>{count}. {'+ ' if added and count else ''}{escape(what)}</td>"
            f"<td>{number(total_rms(np.asarray(stair.step.rms)), 3)}</td>"
            f"<td>{'–' if held_out is None else number(total_rms(np.asarray(held_out)), 3)}</td></tr>"
        )
    return (
        '<div class="fv"><table class="fv-table"><tr><th>Error [Nm]</th><th>fit</th><th>validation</th></tr>'
        f'{"".join(rows)}</table><div class="fv-dim">{COMPARED_IN}.</div></div>'
    )
