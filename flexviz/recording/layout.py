"""The blueprint: what the viewer shows when the recording is opened, a view a question.

Left: what moved (both robots, one tab a group) and what was found (in words). Right: how the states look,
where the model fails, how the solver converged. All has data on the timeline `time`, which is the active one;
the table of iterations has its own timeline, drawings and texts need none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import rerun.blueprint as rrb

from flexviz.measurements import Group, MeasurementSet
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
    observer_path,
    result_path,
)
from flexviz.recording.scene import Stage
from flexviz.recording.texts import group_title

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis


@dataclass(frozen=True)
class Shown:
    """The newest of everything.

    Attributes
    ----------
    observer: name of the observer whose states are there, or None.
    result: number of the newest result, on its way or done, or None.
    label: what its model is, in a few words.
    residuals: the groups whose residual it has.
    diagnosis: the newest diagnosis, or None.
    diagnoses: its number.
    """

    observer: str | None = None
    result: int | None = None
    label: str = ""
    residuals: tuple[str, ...] = ()
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
        rows.append(where_it_fails(groups, shown))
    if shown.result is not None:
        rows.append(convergence(shown.result))
    shares = [2.2 if row.name == "States" else 1.0 for row in rows]
    if not rows:
        rows.append(rrb.Tabs(*(measured(group) for group in groups), name="Measured"))
        shares = [1.0]
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*rows, row_shares=shares), column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="playing", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
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
    if shown.result is not None:
        name = f"Result {shown.result}"
        views.append(rrb.TextDocumentView(origin=result_path(shown.result, "about"), name=name))
    views += [
        rrb.TextDocumentView(origin=group_path(group.name, "about"), name=f"Group {group.name}")
        for group in groups
    ]
    views.append(rrb.TextLogView(origin=LOG, name="Log"))
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


def states(group: Group, observer: str) -> rrb.Container:
    """All observer states of one group; the measured signal lies under the filtered one."""
    names = [*THETA_STATES, *TAU_STATES, *([DISTURBANCE] if observer.startswith("eso") else [])]
    views = [state_view(group, observer, name) for name in names]
    return rrb.Grid(*views, grid_columns=3, name=f"States {group_title(group)}")


def state_view(group: Group, observer: str, name: str) -> rrb.TimeSeriesView:
    """One state of every joint."""
    contents = [observer_path(observer, group.name, name) + "/**"]
    if name in ("theta_0", "tau_0"):
        contents.append(group_path(group.name, "measured", name.partition("_")[0]) + "/**")
    return plot(TITLES[name], "/", contents, legend=False)


def where_it_fails(groups: Sequence[Group], shown: Shown) -> rrb.Container:
    """The residual of the newest result, group by group."""
    views: list[rrb.View | rrb.Container] = []
    for group in groups:
        if group.name in shown.residuals and shown.result is not None:
            origin = result_path(shown.result, "groups", group.name, "residual")
            views.append(plot(f"Residual [Nm] {group_title(group)}", origin, ["$origin/**"]))
    return rrb.Tabs(*views, name="Where it fails")


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
            plot("Parameters / last value", origin, ["$origin/relative/**"], legend=False),
            name=f"Convergence of result {result} (time: s since the start)",
        ),
        table,
        rrb.TextLogView(origin=f"{origin}/stage", name="Stages"),
        name="Convergence",
    )


def plot(name: str, origin: str, contents: Sequence[str], legend: bool = True) -> rrb.TimeSeriesView:
    """Lines over all of whichever timeline is active, `time` or `iteration`."""
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(contents),
        name=name,
        plot_legend=rrb.PlotLegend(corner="RightTop", visible=legend),
        time_ranges=[
            rrb.VisibleTimeRange(
                timeline, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
            )
            for timeline in (TIME, ITERATION)
        ],
    )
