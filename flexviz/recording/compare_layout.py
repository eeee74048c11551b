"""The blueprint of a comparison: what stands left is A, what stands right is B."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from flexviz.charts import COLOURS, rgb
from flexviz.recording.layout import plot
from flexviz.recording.paths import (
    TAU_STATES,
    THETA_STATES,
    TIME,
    TITLES,
    diagnosis_path,
    group_path,
    observer_path,
    result_path,
)
from flexviz.recording.reading import Recording

SIDES = ("/A", "/B")


def compare_blueprint(recordings: Sequence[Recording], largest: Mapping[str, float]) -> rrb.Blueprint:
    """The layout; `largest`: group -> largest residual [Nm], the same scale on both sides."""
    groups = list(dict.fromkeys(group for recording in recordings for group in recording.groups))
    sides = list(zip(SIDES, recordings, strict=True))
    scenes = [
        rrb.Horizontal(*(scene(side, recording, group) for side, recording in sides), name=f"3D {group}")
        for group in groups
    ]
    residuals = [
        rrb.Horizontal(
            *(residual(side, recording, group, largest[group]) for side, recording in sides),
            name=f"Where it fails {group}",
        )
        for group in groups
        if group in largest
    ]
    rows: list[rrb.Container | rrb.View] = [rrb.Tabs(*scenes, name="3D")]
    if residuals:
        rows.append(rrb.Tabs(*residuals, name="Where it fails"))
    rows.append(words(sides, groups))
    return rrb.Blueprint(
        rrb.Vertical(*rows, row_shares=[3, 2, 3][: len(rows)] if residuals else [1, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="playing", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )


def scene(side: str, recording: Recording, group: str) -> rrb.Spatial3DView:
    """Both robots of one recording in one group."""
    eye = None
    if recording.eye is not None and recording.centre is not None:
        eye = rrb.EyeControls3D(position=recording.eye, look_target=recording.centre, eye_up=[0.0, 0.0, 1.0])
    return rrb.Spatial3DView(
        origin=side + group_path(group, "robots"), name=f"{side[1:]} 3D {group}", eye_controls=eye
    )


def residual(side: str, recording: Recording, group: str, largest: float) -> rrb.TimeSeriesView:
    """The newest result's residual in one group."""
    origin = side + result_path(len(recording.results), "groups", group, "residual")
    top = 1.05 * largest or 1.0
    return plot(f"{side[1:]} residual [Nm] {group}", origin, ["$origin/**"], span=(-top, top))


def words(sides: Sequence[tuple[str, Recording]], groups: Sequence[str]) -> rrb.Container:
    """The differences, how both converged, their verdicts, their states one over the other."""
    views: list[rrb.Container | rrb.View] = [rrb.TextDocumentView(origin="/comparison", name="Differences")]
    solved = [(side, result_path(len(r.results), "optimiser")) for side, r in sides if r.results]
    if solved:
        curves = [
            plot(f"{side[1:]} {name}", side + origin, [f"$origin/{entity}"], legend=False)
            for side, origin in solved
            for name, entity in (("cost, log10", "log10_cost"), ("parameters / last value", "relative"))
        ]
        views.append(rrb.Horizontal(*curves, name="Convergence"))
    judged = [(side, r) for side, r in sides if r.diagnoses]
    if judged:
        verdicts = [
            rrb.TextDocumentView(
                origin=side + diagnosis_path(len(r.diagnoses), "verdict"), name=f"{side[1:]} verdict"
            )
            for side, r in judged
        ]
        views.append(rrb.Horizontal(*verdicts, name="Verdicts"))
    abouts = [rrb.TextDocumentView(origin=f"{side}/about", name=f"{side[1:]} about") for side, _ in sides]
    views.append(rrb.Horizontal(*abouts, name="About"))
    views.append(rrb.Tabs(*(states(sides, group) for group in groups), name="States"))
    return rrb.Tabs(*views, name="Differences and more")


def states(sides: Sequence[tuple[str, Recording]], group: str) -> rrb.Container:
    """All observer states of one group, B in colour over A in grey."""
    views = []
    for name in (*THETA_STATES, *TAU_STATES):
        contents: list[str] = []
        overrides: dict[str, Any] = {}
        for side, recording in sides:
            observer = recording.observer
            if observer is None:
                continue
            for joint in recording.joints:
                entity = side + observer_path(observer, group, name, joint)
                contents.append(entity)
                if side == SIDES[0]:
                    style = rr.SeriesLines(colors=rgb(COLOURS.reference), names=f"A {joint}", widths=3.0)
                    overrides[entity] = style.visualizer()
        views.append(plot(TITLES[name], "/", contents, legend=False, overrides=overrides))
    return rrb.Grid(*views, grid_columns=4, name=f"States {group}")
