"""A diagnosis as charts: the error after each added effect, the evidence for a finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.content import wording
from flexviz.content.charts import (
    COLOURS,
    DASHED,
    DASHES,
    Chart,
    ChartAxis,
    ChartSeries,
    no_chart,
    time_chart,
)
from flexviz.content.records import StepEntry

HELD_OUT = "validation"
MAX_GROUPS = 10  # drawn
NOT_PHYSICS = "hatched: not physics"
HATCH_POINTS = 26  # of the zigzag in a hatched step
ERROR_FLOOR = 1e-6  # smallest value drawn on a logarithmic axis
NOISE = "noise"  # its mark: one for all models
EVIDENCE = "evidence"


def staircase_chart(
    steps: Sequence[StepEntry],
    joint: int | None = None,
    name: str = "",
    ticks: Sequence[str] = (),
    spread: Sequence[float] = (),
    hatched: Sequence[int] | None = None,
) -> Chart:
    """The error after each added effect, of one joint or over all (None); `ticks` name the steps.

    In the unit of `wording.JointErrors`; `spread` of the torque, shape (n,) [Nm]. The noise of the recording
    is one line for all models. Steps that add a free curve are hatched: `hatched`, by default those whose
    step says so.
    """
    if hatched is None:
        hatched = [k for k, step in enumerate(steps) if step.added is not None and step.added.stopgap]
    x, last = np.arange(float(len(steps))), wording.stated_errors(steps[-1], spread)
    unit = last.unit
    errors = step_errors(steps, joint, spread)
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
    if last.mark is not None and np.isfinite(low := last.mark.of(joint)) and low > 0:
        floor = np.full(len(steps), max(low, ERROR_FLOOR))
        series.append(ChartSeries(NOISE, COLOURS.reference, x, floor, 1.6, DASHES[2], steps=True))
    if hatched:
        series = hatch(series, hatched)
    fell = (
        f"{group} from {wording.number(values[0], 3)} to {wording.number(values[-1], 3)} {unit}"
        for group, (values, _) in errors.items()
    )
    whose = "of all joints" if joint is None else f"of {name}"
    return Chart(
        "all" if joint is None else "joint",
        f"Error after each added effect, {whose.removeprefix('of ')}",
        ChartAxis(
            "step",
            limits=(-0.5, len(steps) - 0.5),
            ticks=tuple(enumerate(ticks or [str(k) for k in range(len(steps))])),
            whole=True,
        ),
        ChartAxis("rms residual", unit, logarithmic=True),
        tuple(series),
        description=f"{'; '.join(fell)}.",
        height=230,
    )


def hatch(series: Sequence[ChartSeries], hatched: Sequence[int]) -> list[ChartSeries]:
    """Lines of steps with a hatch in some of them, as a line of its own below the others."""
    count = len(series[0].x)
    edges = [np.linspace(k - 0.5, k + 0.5, HATCH_POINTS if k in hatched else 2) for k in range(count)]
    widths, x = [len(edge) for edge in edges], np.concatenate(edges)
    lines = [replace(one, x=x, y=np.repeat(one.y, widths), steps=False) for one in series]
    low, high = np.min([line.y for line in lines], axis=0), np.max([line.y for line in lines], axis=0)
    odd = np.concatenate([np.arange(width) % 2 == 1 for width in widths])
    inside = np.repeat([k in hatched for k in range(count)], widths)
    return [ChartSeries(NOT_PHYSICS, COLOURS.reference, x, np.where(odd & inside, low, high), 0.8), *lines]


def step_errors(
    steps: Sequence[StepEntry], joint: int | None, spread: Sequence[float] = ()
) -> dict[str, tuple[list[float], bool]]:
    """Name -> (error at each step, held out?) of every group; fit and validation if groups are unknown.

    Of one joint or over all (None), in the unit of `wording.JointErrors`.
    """

    def value(row: Sequence[float]) -> float:
        return wording.JointErrors(row, spread).of(joint)

    if all(step.groups for step in steps):
        names = [(one.name, one.validation) for one in steps[-1].groups]
        found: dict[str, tuple[list[float], bool]] = {}
        for name, held_out in names[:MAX_GROUPS]:
            rows = [next((one.rms for one in step.groups if one.name == name), None) for step in steps]
            if all(row is not None for row in rows):
                found[name] = [value(row) for row in rows if row is not None], held_out
        return found
    found = {"fit": ([value(step.rms) for step in steps], False)}
    if all(step.rms_validation is not None for step in steps):
        found[HELD_OUT] = [value(step.rms_validation or ()) for step in steps], True
    return found


def evidence_chart(finding: Any, group: str = "", height: int = 190) -> Chart:
    """The residual before an effect was added and the part that the effect explains, in `group`.

    If the evidence does not contain `group`, the group in which the effect explains most is shown.
    """
    if finding is None:
        return no_chart(EVIDENCE)
    evidence = finding.evidence
    if evidence is None or not len(evidence.time):
        return no_chart(EVIDENCE, "No evidence is kept for this finding.")
    spans = {name: slice(first, last) for name, first, last in evidence.groups}
    chosen = group if group in spans else max(spans, key=lambda name: _power(evidence.signature[spans[name]]))
    rows = spans[chosen]
    time, residual = np.asarray(evidence.time[rows]), np.asarray(evidence.residual[rows])
    signature = np.asarray(evidence.signature[rows])
    if len(time) < 2:
        return no_chart(EVIDENCE)
    name = wording.finding_name(finding)
    chart = time_chart(
        EVIDENCE,
        f"Evidence for {name}, {chosen}",
        "Nm",
        time,
        [
            ("residual without the effect", COLOURS.residual, residual),
            ("explained by the effect", COLOURS.model, signature),
        ],
        height=height,
    )
    before, after = (wording.number(_power(values) ** 0.5, 3) for values in (residual, residual - signature))
    return replace(
        chart,
        x=ChartAxis(f"time in group {chosen}", "s"),
        y=replace(chart.y, label=f"torque on {evidence.joint}"),
        series=(chart.series[0], replace(chart.series[1], dash=DASHED)),
        description=f"Group {chosen}: the residual of {evidence.joint} before the effect was added "
        f"({before} Nm rms) and the part that the effect explains; {after} Nm rms remain.",
        playhead=False,
    )


def _power(values: Array) -> float:
    return float(np.mean(np.square(values))) if len(values) else 0.0
