"""Where the model fails: the share of each joint's residual that follows each variable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.base.statistics import NORMAL_95
from flexviz.content import view
from flexviz.content.blocks import (
    LISTED,
    SMALL_HEIGHT,
    Block,
    Cell,
    Details,
    Figures,
    Items,
    Section,
    TableBlock,
    explanation,
    section,
    table,
)
from flexviz.content.charts import Chart
from flexviz.content.records import ResidualMap, stated_errors
from flexviz.content.results import ResultDocument
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import error_short, share_text, short_names, span_text
from flexviz.model.effects import free_curve
from flexviz.robot.robot import Robot

NOTABLE_SHARE = 0.01  # smallest share of the residual that is listed
ABOUT = (
    "Share of each joint's residual that follows each variable, cross-validated over stretches of time, so "
    "that noise scores about 0. In a joint whose residual is at its noise level nothing is left to explain, "
    "whatever the shares."
)


class Where(Topic):
    """Joint, variable and stretch; a report has the map of all joints, and the worst joint's curves."""

    name = "where"
    title = "Where the model fails"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        places = [place for place in result.where if place.explained > NOTABLE_SHARE][:LISTED]
        if not places or result.final_verdict == "nothing-missing":
            return
        units = {(one.joint, one.variable): one.unit for one in result.maps}
        groups = [group.name for group in result.steps[-1].groups] if result.steps else []
        curved = {effect.joint for effect in result.all_effects if free_curve(effect.effect) is not None}
        texts = []
        for place in places:
            span = span_text(place, units.get((place.joint, place.variable), ""), groups)
            left = " of what no effect explains" if place.joint in curved else ""
            share = f"{share_text(place.explained)}{left}"
            texts.append(f"{place.joint} along {place.variable}: {share}, mostly {span}")
        yield Details(f"{self.title}:", [Items(texts)])

    def section(self, story: Story) -> Section | None:
        diagnosis = story.diagnosis
        if diagnosis is None or not diagnosis.maps:
            return None
        curves = [
            replace(chart, height=SMALL_HEIGHT, note=chart.description)
            for chart in _curves(diagnosis, story.measurements.robot)
            if chart.series
        ]
        last = story.steps[-1] if story.steps else None
        errors = [
            "–" if last is None else error_short(stated_errors(last, story.spread), j)
            for j in range(len(story.joints))
        ]
        caption = "Share of each joint's residual that follows each variable; bold: clearly more than chance"
        found = map_table(diagnosis.maps, story.joints, caption, errors)
        return section(self.title, explanation(ABOUT), found, *([Figures(curves)] if curves else []))


register(Where())


def _curves(diagnosis: Diagnosis, robot: Robot) -> list[Chart]:
    worst = diagnosis.where[0].joint if diagnosis.where else diagnosis.maps[0].joint
    lead = view.leading_map(diagnosis.maps, worst)
    slides = lead is not None and bool(robot.prismatic[robot.joints.index(lead.joint)])
    spectrum = None if lead is None else view.map_of(diagnosis.maps, lead.joint, "frequency")
    return [
        *([] if lead is None else [view.map_chart(lead).of_joint(slides)]),
        *([] if spectrum is None else [view.spectrum_chart(spectrum).of_joint(slides)]),
        view.free_chart(diagnosis.free_curve),
    ]


def map_table(
    maps: Sequence[ResidualMap],
    joints: Sequence[str],
    caption: str,
    errors: Sequence[str] = (),
    chosen: int = -1,
) -> TableBlock:
    """A row per joint, with its error if `errors` are given, and a shaded cell per variable."""
    rows: list[list[str | Cell]] = []
    for j, joint in enumerate(joints):
        row: list[str | Cell] = [Cell(joint, strong=j == chosen), *errors[j : j + 1]]
        for variable in view.MAP_COLUMNS:
            found = view.map_of(maps, joint, variable)
            if found is None or not np.isfinite(found.explained):
                row.append("–")
                continue
            share = min(max(found.explained, 0.0), 1.0)
            exact = f"{100 * found.explained:.1f} ± {100 * NORMAL_95 * found.explained_std:.1f} %"
            tip = f"{joint}, {variable}: {exact}"
            row.append(Cell(f"{100 * share:.0f} %", share, view.notable(found), tip))
        rows.append(row)
    names = view.MAP_COLUMNS if errors else view.MAP_COLUMNS.values()
    head = ("joint", *(["error"] if errors else []), *names)
    return table(head, rows, range(1, len(head)), caption)


def map_panel(maps: Sequence[ResidualMap], joints: Sequence[str], chosen: int = 0) -> list[Block]:
    """The map for the app."""
    if not maps:
        return []
    found = map_table(maps, joints, "Share of the residual that each variable explains", (), chosen)
    rows = [
        [replace(row[0], text=name), *row[1:]]
        for row, name in zip(found.rows, short_names(tuple(joints)), strict=True)
    ]
    note = "Out of sample: mere noise scores 0 %. pos.±: position and direction."
    return [replace(found, rows=rows), explanation(note)]
