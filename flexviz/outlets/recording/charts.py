"""Charts and maps as pictures in a 2D view, and the evidence of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from flexviz.analysis.diagnosis import Finding, Step
from flexviz.analysis.laws import LawThroughData
from flexviz.content.charts import COLOURS, Chart
from flexviz.content.records import ResidualMap
from flexviz.content.view import MAP_COLUMNS, law_chart, map_charts, map_of
from flexviz.content.wording import effect_text_name, finding_name
from flexviz.outlets.recording.paths import TIME, path
from flexviz.outlets.recording.pictures import charts_picture, map_picture
from flexviz.outlets.recording.signals import send_line
from flexviz.outlets.recording.stream import Stream

MAX_EVIDENCE = 3  # findings whose evidence is sent
LAW_HEIGHT = 200  # [px]


def send_charts(stream: Stream, entity: str, charts: Sequence[Chart], columns: int = 2) -> None:
    """Charts in rows of `columns` as one picture; charts without lines are omitted."""
    drawn = [chart for chart in charts if any(len(series.x) > 1 for series in chart.series)]
    if drawn:
        _send_picture(stream, entity, charts_picture(drawn, columns))


def _send_picture(stream: Stream, entity: str, png: bytes) -> None:
    stream.log(entity, rr.EncodedImage(contents=png, media_type="image/png"), static=True)


def send_maps(stream: Stream, where: str, joints: tuple[str, ...], maps: Sequence[ResidualMap]) -> None:
    """Where a model fails: `where`/map of all joints, and `where`/curves/<joint>."""
    if not maps:
        return
    shares = np.full((len(joints), len(MAP_COLUMNS)), np.nan)
    for i, joint in enumerate(joints):
        for j, variable in enumerate(MAP_COLUMNS):
            one = map_of(maps, joint, variable)
            if one is not None:
                shares[i, j] = max(one.explained, 0.0)
    title = "share of each joint's residual that each variable explains, out of sample"
    _send_picture(stream, f"{where}/map", map_picture(title, joints, list(MAP_COLUMNS.values()), shares))
    for joint in joints:
        send_charts(stream, where + path("curves", joint), map_charts(maps, joint), columns=3)


def send_laws(stream: Stream, where: str, laws: Sequence[LawThroughData]) -> None:
    """The law of every effect through its data: `where`/laws."""
    send_charts(stream, f"{where}/laws", [law_chart(law, LAW_HEIGHT) for law in laws], columns=3)


def step_names(steps: Sequence[Step]) -> list[str]:
    """The effect each step has added, from its finding or else from its model."""
    names: list[str] = []
    before: set[str] = set()
    for place, step in enumerate(steps):
        now = before if step.model is None else {effect.text for effect in step.model.effects}
        added = sorted(effect_text_name(text) for text in now - before)
        if step.added is not None:
            added = [finding_name(step.added)]
        names.append(
            "initial model" if place == 0 else f"+ {', '.join(added)}" if added else "without an effect"
        )
        before = now
    return names


def send_evidence(stream: Stream, number: int, rank: int, finding: Finding) -> None:
    """The residual of a finding's joint before the effect is added, and the effect's signature in it."""
    evidence = finding.evidence
    if evidence is None:
        return
    for group, first, last in evidence.groups:
        index = rr.TimeColumn(TIME, duration=evidence.time[first:last])
        for name, values, colour, width in (
            ("residual", evidence.residual, COLOURS.residual, 4.0),
            ("signature", evidence.signature, COLOURS.model, 1.5),
        ):
            entity = path("diagnoses", number, "evidence", rank, group, name)
            label = f"{name} {evidence.joint}"
            send_line(stream, entity, [index], np.asarray(values[first:last]), label, colour, width)
