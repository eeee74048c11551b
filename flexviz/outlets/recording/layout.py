"""The blueprint: what the viewer shows when the recording is opened.

Left: both robots, one tab per group, and the texts. Right: states, where the model fails, convergence.
Everything has data on the active timeline, `time`; the table of iterations has its own timeline, drawings and
texts need none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import AbsoluteTimeRange

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.base.arrays import Array
from flexviz.content.charts import COLOURS, rgb
from flexviz.content.view import offered_curve
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.observers import Observer
from flexviz.outlets.recording.charts import MAX_EVIDENCE
from flexviz.outlets.recording.optimiser import Solve
from flexviz.outlets.recording.paths import ABOUT, ITERATION, LOG, TIME, TITLES, observer_name, path, titled
from flexviz.outlets.recording.scene import Stage
from flexviz.outlets.recording.signals import state_names
from flexviz.outlets.recording.texts import group_title

MAX_RESULT_TABS = 6  # of the newest results' texts
NANOSECONDS = 1_000_000_000  # per second


def blueprint(
    measurements: MeasurementSet,
    stage: Stage,
    observer: Observer | None,
    solves: Sequence[Solve],
    diagnoses: Sequence[Diagnosis],
) -> rrb.Blueprint:
    """The layout for the newest of the recorded content."""
    groups, slides = measurements.groups, measurements.robot.prismatic
    scenes = [_scene(group, stage) for group in groups]
    left = rrb.Vertical(
        rrb.Tabs(*scenes, name="Robots, measured and identified"),
        _texts(groups, solves, diagnoses),
        row_shares=[3, 2],
        name="Motion",
    )
    rows: list[rrb.Container | rrb.View] = []
    if observer is not None:
        rows.append(rrb.Tabs(*(_states(group, observer, slides) for group in groups), name="States"))
    if diagnoses or (solves and solves[-1].residuals):
        rows.append(_where_it_fails(measurements, solves, diagnoses))
    if solves:
        rows.append(_convergence(solves[-1]))
    if not rows:
        rows.append(rrb.Tabs(*(_measured(group, slides) for group in groups), name="Measured"))
    shares = [1.4 if row.name == "States" and len(rows) > 2 else 1.0 for row in rows]
    contents = rrb.Horizontal(left, rrb.Vertical(*rows, row_shares=shares), column_shares=[2, 3])
    # loop over the groups' time only, not over that of a long solve
    first = min(group.segments[0].time[0] for group in groups if group.segments)
    last = max(group.segments[-1].time[-1] for group in groups if group.segments)
    span = AbsoluteTimeRange(round(first * NANOSECONDS), round(last * NANOSECONDS))
    playing = {"timeline": TIME, "play_state": "playing", "loop_mode": "selection", "time_selection": span}
    return rrb.Blueprint(
        contents,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", **playing),
        auto_layout=False,
        auto_views=False,
    )


def _scene(group: Group, stage: Stage) -> rrb.Spatial3DView:
    """Both robots of one group, seen as the stage is."""
    eye = rrb.EyeControls3D(position=stage.eye, look_target=stage.centre, eye_up=[0.0, 0.0, 1.0])
    return rrb.Spatial3DView(
        origin=path("groups", group.name, "robots"),
        name=f"3D {group_title(group)}",
        eye_controls=eye,
        line_grid=rrb.LineGrid3D(visible=True),
    )


def document(origin: str, name: str) -> rrb.TextDocumentView:
    """A text view."""
    return rrb.TextDocumentView(origin=origin, name=name)


def drawing(origin: str, name: str) -> rrb.Spatial2DView:
    """A 2D drawing, which needs no timeline."""
    return rrb.Spatial2DView(origin=origin, name=name)


def plot(
    name: str,
    origin: str,
    contents: Sequence[str],
    legend: bool = True,
    overrides: Mapping[Any, Any] | None = None,
) -> rrb.TimeSeriesView:
    """Lines over the whole active timeline, `time` or `iteration`."""
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(contents),
        name=name,
        overrides=overrides,
        plot_legend=rrb.PlotLegend(corner="RightTop", visible=legend),
        time_ranges=[
            rrb.VisibleTimeRange(
                timeline, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
            )
            for timeline in (TIME, ITERATION)
        ],
    )


def _texts(groups: Sequence[Group], solves: Sequence[Solve], diagnoses: Sequence[Diagnosis]) -> rrb.Container:
    """The set, the verdict, the newest results, each group, the log."""
    views = [document(ABOUT, "About")]
    if diagnoses:
        views.append(document(path("diagnoses", len(diagnoses), "verdict"), "Verdict"))
    for solve in reversed(solves[-MAX_RESULT_TABS:]):
        views.append(document(path("results", solve.number, "about"), f"Result {solve.number}"))
    views += [document(path("groups", group.name, "about"), f"Group {group.name}") for group in groups]
    views.append(document(LOG, "Log"))
    return rrb.Tabs(*views, active_tab=1 if diagnoses else 0, name="In words")


def _measured(group: Group, slides: Array) -> rrb.Container:
    """The recorded signals of one group."""
    views = [
        plot(titled(TITLES[f"{name}_0"], slides), "/", [path("groups", group.name, "measured", name) + "/**"])
        for name in ("theta", "tau")
    ]
    return rrb.Vertical(*views, name=f"Measured {group_title(group)}")


def _states(group: Group, observer: Observer, slides: Array) -> rrb.Container:
    """All observer states of one group, with the measured signals for comparison."""
    views = []
    for name in state_names(observer):
        contents = [path("observers", observer_name(observer), group.name, name) + "/**"]
        if name in ("theta_0", "tau_0"):
            contents.append(path("groups", group.name, "measured", name.partition("_")[0]) + "/**")
        views.append(plot(titled(TITLES[name], slides), "/", contents, legend=False))
    return rrb.Grid(*views, grid_columns=3, name=f"States {group_title(group)}")


def _where_it_fails(
    measurements: MeasurementSet, solves: Sequence[Solve], diagnoses: Sequence[Diagnosis]
) -> rrb.Container:
    """The residual over time and against each variable, the staircase, the findings' evidence."""
    views: list[rrb.View | rrb.Container] = []
    number, where = len(diagnoses), ""
    if solves:
        groups = [group for group in measurements.groups if group.name in solves[-1].residuals]
        if groups:
            over_time = (_residual(measurements, group, solves) for group in groups)
            views.append(rrb.Tabs(*over_time, name="Where it fails: over time"))
        where = path("results", solves[-1].number) if solves[-1].mapped else ""
    if diagnoses and diagnoses[-1].maps and not where:
        where = path("diagnoses", number)
    if where:
        curves = [drawing(where + path("curves", joint), joint) for joint in measurements.joints]
        views.append(drawing(f"{where}/map", "joint × variable"))
        views.append(rrb.Tabs(*curves, name="against each variable"))
    if diagnoses:
        if any(finding.law is not None for one in diagnoses for finding in one.findings):
            views.insert(0, drawing(path("diagnoses", number, "laws"), "Laws through the data"))
        views.append(drawing(path("diagnoses", number, "staircase"), "Errors step by step"))
        if evidence := _evidence(diagnoses[-1], number):
            views.append(rrb.Tabs(*evidence, name="Evidence"))
        if offered_curve(diagnoses[-1]) is not None:
            views.append(drawing(path("diagnoses", number, "free"), "Free curve"))
    return rrb.Tabs(*views, name="Where it fails")


def _residual(measurements: MeasurementSet, group: Group, solves: Sequence[Solve]) -> rrb.TimeSeriesView:
    """The newest result's residual in one group, in front of the first result's in grey."""
    number = solves[-1].number
    origin = path("results", number, "groups", group.name, "residual")
    contents: list[str] = ["$origin/**"]
    overrides: dict[str, Any] = {}
    for joint in measurements.joints if len(solves) > 1 and solves[0].residuals else ():
        before = path("results", 1, "groups", group.name, "residual", joint)
        contents.append(before)
        style = rr.SeriesLines(colors=rgb(COLOURS.reference), names=f"{joint}, result 1", widths=1.0)
        overrides[before] = style.visualizer()
    residual = titled("Residual [Nm]", measurements.robot.prismatic)
    name = f"{residual} {group_title(group)}, result {number}"
    return plot(name, origin, contents, overrides=overrides)


def _evidence(diagnosis: Diagnosis, number: int) -> list[rrb.TimeSeriesView]:
    """Evidence of the best findings, each in its longest group."""
    views = []
    for rank, finding in enumerate(diagnosis.findings[:MAX_EVIDENCE], 1):
        if finding.evidence is not None and finding.evidence.groups:
            group = max(finding.evidence.groups, key=lambda entry: entry[2] - entry[1])[0]
            origin = path("diagnoses", number, "evidence", rank, group)
            views.append(plot(f"{rank}. {finding.text}, {group} [Nm]", origin, ["$origin/**"]))
    return views


def _convergence(solve: Solve) -> rrb.Container:
    """Cost, step and parameters of the newest result, and a table by iteration."""
    origin = path("results", solve.number, "optimiser")
    table = rrb.DataframeView(
        origin=origin,
        contents=["$origin/cost", "$origin/step", "$origin/parameters/**"],
        name="Table by iteration",
        query=rrb.archetypes.DataframeQuery(timeline=ITERATION),
    )
    whole = None  # while it runs, the view follows it
    if solve.result is not None:
        ends = (rrb.TimeRangeBoundary.absolute(seconds=at) for at in (0.0, solve.seconds))
        whole = rrb.TimeAxis(view_range=rrb.TimeRange(*ends))
    return rrb.Tabs(
        rrb.Vertical(
            rrb.Horizontal(
                plot("Cost relative to the start, log10", origin, ["$origin/log10_cost"], legend=False),
                plot("Step, log10", origin, ["$origin/log10_step"], legend=False),
                plot(
                    "Parameters / last value, thin lines: ± 95 %",
                    origin,
                    ["$origin/relative", "$origin/interval"],
                    legend=False,
                ),
                name=f"Convergence of result {solve.number} (time: s since the start)",
            ),
            rrb.StateTimelineView(origin=f"{origin}/stage", name="Stages", time_view=whole, titlebar=False),
            row_shares=[3, 2],
            name="Convergence",
        ),
        table,
        name="Convergence",
    )
