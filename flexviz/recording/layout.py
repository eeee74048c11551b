"""The blueprint: what the viewer shows when the recording is opened, a view a question.

Left: what moved (both robots, one tab a group) and what was found (in words). Right: how the states look,
where the model fails, how the solver converged. All has data on the timeline `time`, which is the active one;
the table of iterations has its own timeline, drawings and texts need none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import AbsoluteTimeRange

from flexviz.charts import COLOURS, rgb
from flexviz.measurements import Group, MeasurementSet
from flexviz.recording.drawings import EVIDENCE
from flexviz.recording.paths import (
    ABOUT,
    DISTURBANCE,
    ITERATION,
    LOG,
    TAU_STATES,
    THETA_STATES,
    TIME,
    TITLES,
    diagnosis_path,
    group_path,
    observer_name,
    observer_path,
    path,
    result_path,
)
from flexviz.recording.scene import Stage
from flexviz.recording.texts import group_title

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis
    from flexviz.observers import Observer


RESULTS = 6  # whose words have a tab
SECOND = 1_000_000_000  # [ns]


@dataclass(frozen=True)
class Shown:
    """The newest of everything.

    Attributes
    ----------
    observer: the observer whose states are there, or None.
    result: number of the newest result, on its way or done, or None.
    label: what its model is, in a few words.
    residuals: the groups whose residual it has.
    first: the joints whose residual the first result has.
    mapped: whether it has maps of where it fails.
    diagnosis: the newest diagnosis, or None.
    diagnoses: its number.
    """

    observer: Observer | None = None
    result: int | None = None
    label: str = ""
    residuals: tuple[str, ...] = ()
    first: tuple[str, ...] = ()
    mapped: bool = False
    diagnosis: Diagnosis | None = None
    diagnoses: int = 0


def blueprint(measurements: MeasurementSet, stage: Stage, shown: Shown) -> rrb.Blueprint:
    """The layout for what there is."""
    groups = measurements.groups
    left = rrb.Vertical(
        rrb.Tabs(*(scene(group, stage) for group in groups), name="Robots, measured and identified"),
        words(groups, shown),
        row_shares=[3, 2],
        name="Motion",
    )
    rows: list[rrb.Container | rrb.View] = []
    if shown.observer is not None:
        rows.append(rrb.Tabs(*(states(group, shown.observer) for group in groups), name="States"))
    if shown.residuals or shown.diagnosis is not None:
        rows.append(where_it_fails(measurements, shown))
    if shown.result is not None:
        rows.append(convergence(shown.result))
    shares = [2.0 if row.name == "States" else 1.0 for row in rows]
    if not rows:
        rows.append(rrb.Tabs(*(measured(group) for group in groups), name="Measured"))
        shares = [1.0]
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*rows, row_shares=shares), column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        time_panel(groups),
        auto_layout=False,
        auto_views=False,
    )


def time_panel(groups: Sequence[Group]) -> rrb.TimePanel:
    """Plays the groups' own time again and again; a long solve does not lengthen it."""
    ends = [(group.segments[0].time[0], group.segments[-1].time[-1]) for group in groups if group.segments]
    first, last = (pick(end) for pick, end in zip((min, max), zip(*ends, strict=True), strict=True))
    return rrb.TimePanel(
        state="collapsed",
        timeline=TIME,
        play_state="playing",
        loop_mode="selection",
        time_selection=AbsoluteTimeRange(round(first * SECOND), round(last * SECOND)),
    )


def scene(group: Group, stage: Stage) -> rrb.Spatial3DView:
    """Both robots of one group."""
    return rrb.Spatial3DView(
        origin=group_path(group.name, "robots"),
        name=f"3D {group_title(group)}",
        eye_controls=rrb.EyeControls3D(position=stage.eye, look_target=stage.centre, eye_up=[0.0, 0.0, 1.0]),
        line_grid=rrb.LineGrid3D(visible=True),
    )


def words(groups: Sequence[Group], shown: Shown) -> rrb.Container:
    """All that is said: the set, the verdict, the newest result, each group, what happened."""
    views: list[rrb.View] = [rrb.TextDocumentView(origin=ABOUT, name="About")]
    if shown.diagnosis is not None:
        views.append(rrb.TextDocumentView(origin=diagnosis_path(shown.diagnoses, "verdict"), name="Verdict"))
    for number in range(shown.result or 0, max((shown.result or 0) - RESULTS, 0), -1):
        views.append(rrb.TextDocumentView(origin=result_path(number, "about"), name=f"Result {number}"))
    views += [
        rrb.TextDocumentView(origin=group_path(group.name, "about"), name=f"Group {group.name}")
        for group in groups
    ]
    views.append(rrb.TextDocumentView(origin=LOG, name="Log"))
    return rrb.Tabs(*views, active_tab=1 if shown.diagnosis is not None else 0, name="In words")


def measured(group: Group) -> rrb.Container:
    """What was recorded of one group, before anything is made of it."""
    return rrb.Vertical(
        *(
            plot(TITLES[f"{name}_0"], "/", [group_path(group.name, "measured", name) + "/**"])
            for name in ("theta", "tau")
        ),
        name=f"Measured {group_title(group)}",
    )


def states(group: Group, observer: Observer) -> rrb.Container:
    """All observer states of one group; the measured signal lies under the filtered one."""
    names = [*THETA_STATES, *TAU_STATES, *([DISTURBANCE] if observer.has_disturbance_state else [])]
    views = [state_view(group, observer, name) for name in names]
    return rrb.Grid(*views, grid_columns=3, name=f"States {group_title(group)}")


def state_view(group: Group, observer: Observer, name: str) -> rrb.TimeSeriesView:
    """One state of every joint."""
    contents = [observer_path(observer_name(observer), group.name, name) + "/**"]
    if name in ("theta_0", "tau_0"):
        contents.append(group_path(group.name, "measured", name.partition("_")[0]) + "/**")
    return plot(TITLES[name], "/", contents, legend=False)


def where_it_fails(measurements: MeasurementSet, shown: Shown) -> rrb.Container:
    """The residual group by group, against every variable; what the findings take from it; how it falls."""
    views: list[rrb.View | rrb.Container] = []
    over_time = [residual(group, shown) for group in measurements.groups if group.name in shown.residuals]
    if over_time:
        views.append(rrb.Tabs(*over_time, name="Where it fails: over time"))
    final = shown.diagnosis is not None and bool(shown.diagnosis.maps) and not shown.mapped
    if final or shown.mapped:
        where = diagnosis_path(shown.diagnoses) if final else result_path(shown.result or 0)
        curves = [drawing(where + path("curves", joint), joint) for joint in measurements.joints]
        views.append(drawing(f"{where}/map", "joint × variable"))
        views.append(rrb.Tabs(*curves, name="against each variable"))
    if shown.diagnosis is not None:
        views.append(drawing(diagnosis_path(shown.diagnoses, "staircase"), "Errors step by step"))
        if taken := evidence(shown.diagnosis, shown.diagnoses):
            views.append(rrb.Tabs(*taken, name="Evidence"))
        if shown.diagnosis.free_curve is not None:
            views.append(drawing(diagnosis_path(shown.diagnoses, "free"), "Free curve"))
    return rrb.Tabs(*views, name="Where it fails")


def residual(group: Group, shown: Shown) -> rrb.TimeSeriesView:
    """The newest result's residual in one group; behind it, grey, the first result's."""
    assert shown.result is not None
    origin = result_path(shown.result, "groups", group.name, "residual")
    contents: list[str] = ["$origin/**"]
    overrides: dict[str, Any] = {}
    if shown.result > 1 and shown.first:
        for joint in shown.first:
            before = result_path(1, "groups", group.name, "residual") + path(joint)
            contents.append(before)
            style = rr.SeriesLines(colors=rgb(COLOURS.reference), names=f"{joint}, result 1", widths=1.0)
            overrides[before] = style.visualizer()
    name = f"Residual [Nm] {group_title(group)}, result {shown.result}"
    return plot(name, origin, contents, overrides=overrides)


def evidence(diagnosis: Diagnosis, number: int) -> list[rrb.TimeSeriesView]:
    """What the first findings take from the residual, each in the group where it has most samples."""
    views = []
    for rank, finding in enumerate(diagnosis.findings[:EVIDENCE], 1):
        if finding.evidence is not None and finding.evidence.groups:
            group = max(finding.evidence.groups, key=lambda entry: entry[2] - entry[1])[0]
            origin = diagnosis_path(number, "evidence", str(rank), group)
            views.append(plot(f"{rank}. {finding.text}, {group} [Nm]", origin, ["$origin/**"]))
    return views


def drawing(origin: str, name: str) -> rrb.Spatial2DView:
    """A drawing that needs no timeline."""
    return rrb.Spatial2DView(origin=origin, name=name)


def convergence(result: int) -> rrb.Container:
    """Cost, step and parameters of the newest result, and all of them as a table by iteration."""
    origin = result_path(result, "optimiser")
    table = rrb.DataframeView(
        origin=origin,
        contents=["$origin/cost", "$origin/step", "$origin/parameters/**"],
        name="Table by iteration",
        query=rrb.archetypes.DataframeQuery(timeline=ITERATION),
    )
    return rrb.Tabs(
        rrb.Horizontal(
            plot("Cost, log10", origin, ["$origin/log10_cost"], legend=False),
            plot("Step, log10", origin, ["$origin/log10_step"], legend=False),
            plot("Parameters / last value", origin, ["$origin/relative"], legend=False),
            name=f"Convergence of result {result} (time: s since the start)",
        ),
        table,
        rrb.TextLogView(origin=f"{origin}/stage", name="Stages"),
        name="Convergence",
    )


def plot(
    name: str,
    origin: str,
    contents: Sequence[str],
    legend: bool = True,
    overrides: Mapping[Any, Any] | None = None,
    span: tuple[float, float] | None = None,
) -> rrb.TimeSeriesView:
    """Lines over all of whichever timeline is active, `time` or `iteration`; `span`: of the ordinate."""
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(contents),
        name=name,
        overrides=overrides,
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
        plot_legend=rrb.PlotLegend(corner="RightTop", visible=legend),
        time_ranges=[
            rrb.VisibleTimeRange(
                timeline, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
            )
            for timeline in (TIME, ITERATION)
        ],
    )
