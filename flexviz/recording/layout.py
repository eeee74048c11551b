"""The blueprint: what the viewer shows when the recording is opened.

Left both robots, one tab a group; right the states, the residual and the optimiser's way. Everything has data
on the timeline `time`, which is the active one; the table of iterations has its own timeline.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from flexviz.measurements import Group, MeasurementSet
from flexviz.recording.paths import (
    DISTURBANCE,
    ITERATION,
    OPTIMISER,
    SUMMARY,
    TAU_STATES,
    THETA_STATES,
    TIME,
    TITLES,
    group_path,
    parameter_path,
    path,
)
from flexviz.recording.scene import Stage
from flexviz.recording.texts import group_title

SECOND = 1_000_000_000  # [ns]


def blueprint(
    measurements: MeasurementSet,
    stage: Stage,
    simulated: Sequence[str],
    residuals: Sequence[str],
    parameters: Sequence[str],
    disturbance: bool,
) -> rrb.Blueprint:
    """The layout.

    Parameters
    ----------
    simulated, residuals: names of the groups whose model was simulated, whose residual there is.
    parameters: names of what the iterations tell about (none: there are no iterations).
    disturbance: whether the observer has a disturbance state.
    """
    groups = measurements.groups
    scenes = [scene(group, stage, group.name in simulated) for group in groups]
    left = rrb.Vertical(
        rrb.Tabs(*scenes, name="Robots"),
        rrb.Tabs(
            rrb.TextDocumentView(origin=SUMMARY, name="Summary"),
            *(
                rrb.TextDocumentView(origin=group_path(g.name, "about"), name=f"About {g.name}")
                for g in groups
            ),
        ),
        row_shares=[3, 2],
        name="Motion",
    )
    right: list[rrb.Container | rrb.View] = [rrb.Tabs(*states_tabs(groups, disturbance), name="States")]
    lower: list[rrb.Container | rrb.View] = []
    if residuals:
        lower.append(rrb.Tabs(*(residual_view(g) for g in groups if g.name in residuals), name="Residual"))
    if parameters:
        lower.append(convergence(parameters))
    right += lower
    shares = [2.2] + [1.0] * len(lower)
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*right, row_shares=shares), column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="playing", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )


def scene(group: Group, stage: Stage, both: bool) -> rrb.Spatial3DView:
    """Both robots of one group."""
    return rrb.Spatial3DView(
        origin=group_path(group.name, "robots"),
        name=f"3D {group_title(group)}: {'measured and identified' if both else 'measured'}",
        eye_controls=rrb.EyeControls3D(position=stage.eye, look_target=stage.centre, eye_up=[0.0, 0.0, 1.0]),
        line_grid=rrb.LineGrid3D(visible=True),
    )


def states_tabs(groups: Sequence[Group], disturbance: bool) -> list[rrb.Container]:
    """One tab a group with all observer states; the measured signal lies under the filtered one."""
    names = [*THETA_STATES, *TAU_STATES, *([DISTURBANCE] if disturbance else [])]
    return [
        rrb.Grid(
            *(state_view(group, name) for name in names), grid_columns=3, name=f"States {group_title(group)}"
        )
        for group in groups
    ]


def state_view(group: Group, name: str) -> rrb.TimeSeriesView:
    """One state of every joint."""
    contents = [group_path(group.name, "states", name) + "/**"]
    if name in ("theta_0", "tau_0"):
        contents.append(group_path(group.name, "measured", name.partition("_")[0]) + "/**")
    return plot(TITLES[name], group_path(group.name), contents, legend=False)


def residual_view(group: Group) -> rrb.TimeSeriesView:
    """The identification equation's residual of every joint."""
    where = group_path(group.name, "identification", "residual")
    return plot(f"Residual [Nm] {group_title(group)}", where, ["$origin/**"])


def convergence(parameters: Sequence[str]) -> rrb.Container:
    """Cost, step and parameters, and all of them as a table by iteration."""
    entities = [path("optimiser", "cost"), path("optimiser", "step")]
    entities += [parameter_path("parameters", name) for name in parameters]
    table = rrb.DataframeView(
        origin=OPTIMISER,
        contents=entities,
        name="Table by iteration",
        query=rrb.archetypes.DataframeQuery(timeline=ITERATION, entity_order=entities),
    )
    return rrb.Tabs(
        rrb.Horizontal(
            plot("Cost, log10", OPTIMISER, [path("optimiser", "log10_cost")], legend=False),
            plot("Step, log10", OPTIMISER, [path("optimiser", "log10_step")], legend=False),
            plot("Parameters / last value", OPTIMISER, [path("optimiser", "relative") + "/**"], legend=False),
            name="Convergence (time: s since the start)",
        ),
        table,
        rrb.TextLogView(origin=path("optimiser", "stage"), name="Stages"),
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
