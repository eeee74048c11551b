"""Two recordings merged, side by side, with what differs between their newest results."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader, Selector

from flexviz.charts import COLOURS, rgb
from flexviz.comparing import compare, facts, numbers, remarks
from flexviz.files import named_errors
from flexviz.recording.file_sink import FileSink
from flexviz.recording.files import hidden
from flexviz.recording.layout import document, page, plot, scene_view
from flexviz.recording.paths import APPLICATION, STATES, TITLES, path
from flexviz.recording.reading import Recording
from flexviz.wording import as_markdown, markdown_table

SCALARS = "Scalars:scalars"
FRAMES = ("Transform3D:child_frame", "Transform3D:parent_frame", "CoordinateFrame:frame")
Views = list[rrb.Container | rrb.View]
Sides = tuple[tuple[str, Recording], tuple[str, Recording]]  # with their names, A and B


def comparison_text(a: Recording, b: Recording) -> str:
    """The newest results of two recordings side by side, as Markdown."""
    found = compare([a.known, b.known])
    lines = [f"# A: {as_markdown(a.file.name)} and B: {as_markdown(b.file.name)}"]
    for table in (facts(found), numbers(found, inertial=True)):
        rows = (list(map(as_markdown, row)) for row in table.rows)
        lines += ["", *markdown_table(list(map(as_markdown, table.head)), rows, table.numbers)]
    return "\n".join([*lines, "", *map(as_markdown, remarks(found))])


def merge_recordings(a: Recording, b: Recording, out: Path) -> None:
    """Write two recordings and their comparison side by side: entities /A/…, /B/…, /comparison."""
    sides: Sides = ("A", a), ("B", b)
    stream = rr.RecordingStream(f"{APPLICATION} comparison")
    part = hidden(out)
    with named_errors(out):
        try:
            # the layout first: the viewer shows a file while it loads
            sink = FileSink(stream, part, _blueprint(sides))
            stream.send_recording_name(f"{a.file.stem} and {b.file.stem}")
            text = rr.TextDocument(comparison_text(a, b), media_type=rr.MediaType.MARKDOWN)
            stream.log("/comparison", text, static=True)
            sink.flush()
            for side, recording in sides:
                chunks = RrdReader(str(recording.file)).stream().drop(content="/__properties/**")
                stream.send_chunks(chunks.map(partial(_under, side)))
            sink.close()
            os.replace(part, out)
        finally:
            part.unlink(missing_ok=True)


def _under(side: str, chunk: Chunk) -> Chunk:
    """The chunk below /`side`; its named frames, the same in both recordings, are prefixed likewise."""
    columns = chunk.to_record_batch().schema.names
    for frame in FRAMES:
        if frame in columns:
            chunk = chunk.apply_selector(frame, Selector(".").pipe(partial(_prefixed, f"{side}/")))
    return chunk.with_entity_path(f"/{side}{chunk.entity_path}")


def _prefixed(prefix: str, names: pa.Array) -> pa.Array:
    return pa.array([prefix + name for name in names.to_pylist()])


def _largest_residuals(recording: Recording) -> dict[str, float]:
    """Group -> largest residual of the newest result [Nm]."""
    found: dict[str, float] = {}
    for group in recording.groups:
        where = path("results", len(recording.results), "groups", group, "residual")
        values = [
            float(np.nanmax(np.abs(np.asarray(batch.column(SCALARS).flatten(), dtype=float)), initial=0.0))
            for chunk in RrdReader(str(recording.file)).stream().filter(content=f"{where}/**")
            if SCALARS in (batch := chunk.to_record_batch()).schema.names
        ]
        if values:
            found[group] = max(values)
    return found


def _blueprint(sides: Sides) -> rrb.Blueprint:
    """A on the left, B on the right; both residuals of a group have the same scale."""
    groups = list(dict.fromkeys(group for _, recording in sides for group in recording.groups))
    scenes = [
        rrb.Horizontal(
            *(scene_view(f"/{side}", f"{side} 3D {group}", group, r.eye, r.centre) for side, r in sides),
            name=f"3D {group}",
        )
        for group in groups
    ]
    largest = [_largest_residuals(recording) for _, recording in sides]
    residuals = []
    for group in groups:
        if tops := [one[group] for one in largest if group in one]:
            top = 1.05 * max(tops) or 1.0
            views = (_residual(side, recording, group, top) for side, recording in sides)
            residuals.append(rrb.Horizontal(*views, name=f"Where it fails {group}"))
    rows: Views = [rrb.Tabs(*scenes, name="3D")]
    if residuals:
        rows.append(rrb.Tabs(*residuals, name="Where it fails"))
    rows.append(_details(sides, groups))
    return page(rrb.Vertical(*rows, row_shares=[3, 2, 3] if residuals else [1, 1]), loop_mode="all")


def _residual(side: str, recording: Recording, group: str, top: float) -> rrb.TimeSeriesView:
    """The newest result's residual in one group, up to ± `top` [Nm]."""
    origin = f"/{side}" + path("results", len(recording.results), "groups", group, "residual")
    return plot(f"{side} residual [Nm] {group}", origin, ["$origin/**"], span=(-top, top))


def _details(sides: Sides, groups: Sequence[str]) -> rrb.Container:
    """Differences, convergence, verdicts, descriptions, and the states of A and B overlaid."""
    curves, verdicts, about = [], [], []
    for side, r in sides:
        optimiser = f"/{side}" + path("results", len(r.results), "optimiser")
        for name, entity in (("relative cost, log10", "log10_cost"), ("parameters / last value", "relative")):
            if r.results:
                curves.append(plot(f"{side} {name}", optimiser, [f"$origin/{entity}"], legend=False))
        if r.diagnoses:
            verdict = f"/{side}" + path("diagnoses", len(r.diagnoses), "verdict")
            verdicts.append(document(verdict, f"{side} verdict"))
        about.append(document(f"/{side}/about", f"{side} about"))
    rows = {"Convergence": curves, "Verdicts": verdicts, "About": about}
    return rrb.Tabs(
        document("/comparison", "Differences"),
        *(rrb.Horizontal(*views, name=name) for name, views in rows.items() if views),
        rrb.Tabs(*(_states(sides, group) for group in groups), name="States"),
        name="Differences and more",
    )


def _states(sides: Sides, group: str) -> rrb.Container:
    """All observer states of one group, B in colour over A in grey."""
    views = []
    for name in STATES:
        contents: list[str] = []
        overrides: dict[str, Any] = {}
        for side, recording in sides:
            for joint in recording.joints if recording.observer is not None else ():
                entity = f"/{side}" + path("observers", recording.observer, group, name, joint)
                contents.append(entity)
                if side == "A":
                    style = rr.SeriesLines(colors=rgb(COLOURS.reference), names=f"A {joint}", widths=3.0)
                    overrides[entity] = style.visualizer()
        views.append(plot(TITLES[name], "/", contents, legend=False, overrides=overrides))
    return rrb.Grid(*views, grid_columns=4, name=f"States {group}")
