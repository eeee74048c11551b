"""Drawings of a diagnosis: where the model fails, the error step by step, evidence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from flexviz.charts import COLOURS
from flexviz.recording.charts import send_charts, send_map
from flexviz.recording.paths import TIME, diagnosis_path, path
from flexviz.recording.signals import send_line
from flexviz.recording.stream import Stream
from flexviz.view import MAP_COLUMNS, free_chart, map_charts, map_of, staircase_chart
from flexviz.wording import effect_text_name, finding_name

if TYPE_CHECKING:
    from flexviz.diagnosis import Finding, FreeCurve, ResidualMap, Step

MAX_EVIDENCE = 3  # findings whose evidence is sent


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
    send_map(stream, f"{where}/map", title, joints, list(MAP_COLUMNS.values()), shares)
    for joint in joints:
        send_charts(stream, where + path("curves", joint), map_charts(maps, joint), columns=3)


def send_staircase(stream: Stream, where: str, steps: Sequence[Step]) -> None:
    """The error of every group after each added effect."""
    send_charts(stream, f"{where}/staircase", [staircase_chart(steps, ticks=step_names(steps))])


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


def send_free_curve(stream: Stream, where: str, curve: FreeCurve | None) -> None:
    """The free curve fitted to the unexplained residual."""
    send_charts(stream, f"{where}/free", [free_chart(curve)])


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
            entity = diagnosis_path(number, "evidence", str(rank), group, name)
            label = f"{name} {evidence.joint}"
            send_line(stream, entity, [index], np.asarray(values[first:last]), label, colour, width)
