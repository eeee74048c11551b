"""The summary of a study: bias, spread and coverage; spread of a bootstrap; bandwidths; detection."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from flexviz import __version__
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import COLOURS, Chart, ChartAxis, ChartSeries, Ribbon
from flexviz.content.wording import number, percent, plural
from flexviz.outlets.batch.page import parameter_words
from flexviz.outlets.batch.study_plan import StudyPlan, StudyRun, is_right
from flexviz.outlets.report import (
    Block,
    ReportDocument,
    Section,
    Tile,
    Tiles,
    explanation,
    html,
    section,
    table,
)

LEAST_DETECTED = 0.9  # share of the runs from which a size counts as detected


@dataclass(frozen=True)
class ParameterSpread:
    """One parameter over the runs of a study.

    Attributes:
        count: runs that have it.
        mean, spread: mean and standard deviation of the estimates; NaN for one run.
        claimed: root mean square of the standard errors, of the runs that determine the parameter.
        bias, coverage: mean minus truth, and share of the 95 % intervals that hold it; None without a truth
            or without intervals.
    """

    parameter: str
    unit: str
    count: int
    mean: float
    spread: float
    claimed: float
    bias: float | None
    coverage: float | None


def spreads(runs: Sequence[StudyRun]) -> list[ParameterSpread]:
    """Every parameter over all runs."""
    found: dict[str, list[tuple[float, float, str, float]]] = defaultdict(list)
    for run in runs:
        for name, (value, std, unit, _) in run.parameters.items():
            truth = run.truth.get(name, math.nan)
            found[name].append((value, math.nan if std is None else std, unit, truth))
    out = []
    for name, entries in found.items():
        value, std, truth = (np.array([entry[i] for entry in entries]) for i in (0, 1, 3))
        error = value - truth
        known, stated = bool(np.isfinite(error).all()), np.isfinite(std)
        inside = np.abs(error) <= NORMAL_95 * std
        out.append(
            ParameterSpread(
                name, entries[0][2], len(entries), float(value.mean()),
                float(value.std(ddof=1)) if len(value) > 1 else math.nan,
                float(np.sqrt(np.mean(std[stated] ** 2))) if stated.any() else math.nan,
                float(error.mean()) if known else None,
                float(np.mean(inside[stated])) if known and stated.any() else None,
            )
        )  # fmt: skip
    return out


def detected(plan: StudyPlan, runs: Sequence[StudyRun]) -> list[tuple[float, int, int]]:
    """(size, runs in which exactly the hidden effect was found, runs) of a study of kind "detection"."""
    right, of = Counter[float](), Counter[float]()
    for run in runs:
        if run.setting is not None and (verdict := is_right(plan, run)) is not None:
            of[run.setting] += 1
            right[run.setting] += verdict
    return [(size, right[size], of[size]) for size in sorted(of)]


def detection_limit(counts: Sequence[tuple[float, int, int]]) -> float | None:
    """The smallest size from which on `LEAST_DETECTED` of the runs are right at every size tried."""
    limit = None
    for size, right, of in reversed([one for one in counts if one[0] > 0]):
        if right < LEAST_DETECTED * of:
            break
        limit = size
    return limit


def study_page(plan: StudyPlan, runs: Sequence[StudyRun], when: datetime) -> str:
    """The page as HTML text."""
    shown = when.strftime("%Y-%m-%d %H:%M")
    title = f"Study: {plan.kind.replace('-', ' ')} of {Path(plan.source).name}"
    footer, subtitle = f"Written by flexviz {__version__} on {shown}.", f"{plural(len(runs), 'run')}; {shown}"
    return html(ReportDocument(title, subtitle, [], study_sections(plan, runs), footer))


def study_sections(plan: StudyPlan, runs: Sequence[StudyRun]) -> list[Section]:
    """What the runs say together, and why some failed."""
    done = [run for run in runs if run.result is not None]
    failed = Counter(run.error for run in runs if run.error)
    tile = Tile("runs", str(len(runs)), f"{len(done)} done, {sum(failed.values())} failed or not done")
    sections = [section("Summary", Tiles([tile]))]
    if failed:
        body = [[error, str(count)] for error, count in failed.most_common(20)]
        sections.append(section("Failed or not done", table(("error", "runs"), body, numbers=(1,))))
    if done:
        evaluated = {"bandwidth": _bandwidth, "detection": _detection}.get(plan.kind, _spread)
        sections.append(evaluated(plan, done))
    return sections


def _spread(plan: StudyPlan, runs: Sequence[StudyRun]) -> Section:
    """Bias, spread, claimed standard error and coverage."""
    rows = []
    for one in spreads(runs):
        ratio = one.claimed / one.spread if one.spread > 0 else math.nan
        cells = [number(one.mean, 5), number(one.spread, 3), number(one.claimed, 3), number(ratio, 2)]
        bias = ["–" if one.bias is None else number(one.bias, 2)]
        bias.append("–" if one.coverage is None else f"{100 * one.coverage:.0f} %")
        rows.append([parameter_words(one.parameter), one.unit, *cells, *bias, str(one.count)])
    head = ("parameter", "unit", "mean", "spread", "standard error", "ratio", "bias", "in 95 %", "runs")
    about = (
        "Spread: standard deviation over the runs. Standard error: as each run states it (root mean square); "
        "ratio: of the two. In 95 %: share of the intervals that hold the truth."
    )
    blocks: list[Block] = [explanation(about), table(head, rows, numbers=range(2, 9), dense=True)]
    verdicts = [right for run in runs if (right := is_right(plan, run)) is not None]
    if verdicts:
        share = f"{sum(verdicts)} of {len(verdicts)}"
        blocks.append(explanation(f"Diagnoses that found exactly the hidden effects: {share}."))
    return section("Parameters", *blocks)


def _bandwidth(plan: StudyPlan, runs: Sequence[StudyRun]) -> Section:
    """Error and parameters against the bandwidth."""
    runs = sorted(runs, key=lambda run: run.setting or 0.0)
    w = np.array([run.setting or 0.0 for run in runs])
    x = ChartAxis("bandwidth", "rad/s", logarithmic=True)
    error = np.array([100 * (run.result or {}).get("residual", math.nan) for run in runs])
    least = float(w[int(np.nanargmin(error))])
    series = (ChartSeries("error", COLOURS.residual, w, error, points=True),)
    text = f"Least at {least:g} rad/s. A least error says little about the parameters of a causal observer."
    rows = [[number(at, 4), number(value, 3)] for at, value in zip(w, error, strict=True)]
    charts: list[Block] = [
        table(("bandwidth [rad/s]", "error [% of the torque]"), rows, (0, 1)),
        Chart(
            "error", "Error against bandwidth", x, ChartAxis("of the torque", "%"), series, description=text
        ),
    ]
    for name in [n for n in runs[0].parameters if n.partition(":")[0] in ("stiffness", "motor_inertia")]:
        entries = [run.parameters.get(name, (math.nan, None, "", "")) for run in runs]
        value = np.array([entry[0] for entry in entries])
        half = NORMAL_95 * np.array([entry[1] or 0.0 for entry in entries])
        y = ChartAxis(parameter_words(name), entries[0][2])
        band = (Ribbon("± 95 %", COLOURS.measured, w, value - half, value + half),)
        lines = (ChartSeries("value", COLOURS.measured, w, value, points=True),)
        about = "A value that moves with the bandwidth has the observer's error in it."
        charts.append(Chart(name, parameter_words(name), x, y, lines, band, description=about))
    return section("Bandwidth", *charts)


def _detection(plan: StudyPlan, runs: Sequence[StudyRun]) -> Section:
    """Share of the runs in which exactly the hidden effect is found, by its size."""
    counts = detected(plan, runs)
    limit, smallest = detection_limit(counts), [one for one in counts if one[0] == 0]
    body = [[number(s, 3), f"{right} of {of}", percent(right / of)] for s, right, of in counts if s > 0]
    said = (
        f"From {number(limit, 3)} on at least {100 * LEAST_DETECTED:.0f} % of the runs are right."
        if limit is not None
        else f"No size reaches {100 * LEAST_DETECTED:.0f} % of the runs."
    )
    if smallest:
        said += f" With nothing hidden, {smallest[0][2] - smallest[0][1]} of {smallest[0][2]} name an effect."
    blocks: list[Block] = [explanation(f"{plan.hidden[0]}, {plan.parameter}: {said}")]
    if body:
        blocks.append(table((plan.parameter, "found exactly", "share"), body, numbers=(0, 1, 2)))
    sizes = [one for one in counts if one[0] > 0]
    if len(sizes) > 1:
        x, y = np.array([one[0] for one in sizes]), np.array([100 * one[1] / one[2] for one in sizes])
        axis = ChartAxis(plan.parameter, "", logarithmic=True)
        line = (ChartSeries("found", COLOURS.measured, x, y, points=True),)
        blocks.append(Chart("found", "Found against size", axis, ChartAxis("of the runs", "%"), line))
    return section("Detection", *blocks)
