"""Compare the newest results of two recordings, and merge both side by side."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader, Selector

from flexviz.charts import COLOURS, rgb
from flexviz.files import named_errors
from flexviz.recording.file_sink import FileSink
from flexviz.recording.files import hidden
from flexviz.recording.layout import document, page, plot, scene_view
from flexviz.recording.paths import APPLICATION, STATES, TITLES, path
from flexviz.recording.reading import Recording
from flexviz.records import ObserverEntry
from flexviz.wording import JointErrors, as_markdown, markdown_table, number, total_rms

SCALARS = "Scalars:scalars"
FRAMES = ("Transform3D:child_frame", "Transform3D:parent_frame", "CoordinateFrame:frame")
NOTABLE_DEVIATIONS = 3.0  # [standard errors] larger differences are rarely chance, even among 100 parameters
Views = list[rrb.Container | rrb.View]


@dataclass(frozen=True)
class ParameterDifference:
    """One parameter: `values` and `stds` in A and B [unit]; NaN where missing."""

    name: str
    joint: str | None
    unit: str
    values: tuple[float, float]
    stds: tuple[float, float]

    @property
    def deviations(self) -> float:
        """The difference divided by its standard error; NaN if unknown."""
        spread = math.hypot(*self.stds)
        difference = abs(self.values[0] - self.values[1])
        if math.isnan(difference) or math.isnan(spread):
            return math.nan
        return difference / spread if spread > 0 else (0.0 if difference == 0 else math.inf)


@dataclass(frozen=True)
class RecordingComparison:
    """The newest results of two recordings.

    Attributes:
        rows: parameters of either recording.
        rms: over all joints [Nm] in A and B; NaN if missing.
        facts: title -> texts for A and B: set, model, effects, observer, errors, verdict.
    """

    a: Recording
    b: Recording
    rows: tuple[ParameterDifference, ...]
    rms: tuple[float, float]
    facts: dict[str, tuple[str, str]]

    @property
    def sides(self) -> tuple[tuple[str, Recording], tuple[str, Recording]]:
        """Both recordings with their names."""
        return ("A", self.a), ("B", self.b)

    @property
    def notable(self) -> list[ParameterDifference]:
        """Parameters that differ by more than `NOTABLE_DEVIATIONS`, largest difference first."""
        return [row for row in sorted(self.rows, key=_rank) if row.deviations > NOTABLE_DEVIATIONS]


def compare_recordings(a: Recording, b: Recording) -> RecordingComparison:
    """Compare the newest results of two recordings."""
    tables = [
        {(p["name"], p["joint"], p.get("payload"), p.get("group")): p for p in r.result.get("parameters", ())}
        for r in (a, b)
    ]
    rows = []
    for key, one in (tables[0] | tables[1]).items():
        in_a, in_b = (table.get(key, {}) for table in tables)
        values = _float(in_a.get("value")), _float(in_b.get("value"))
        stds = _float(in_a.get("std")), _float(in_b.get("std"))
        rows.append(ParameterDifference(one["name"], one["joint"], one.get("unit", ""), values, stds))
    facts = {title: (text, _facts(b)[title]) for title, text in _facts(a).items()}
    return RecordingComparison(a, b, tuple(rows), (_rms(a, "rms"), _rms(b, "rms")), facts)


def _facts(recording: Recording) -> dict[str, str]:
    """Title -> text of the newest result."""
    result = recording.result
    observer = result.get("observer")
    entry = None if observer is None else ObserverEntry(**observer)
    return {
        "set": recording.set_name,
        "model": result.get("label") or "–",
        "effects": ", ".join(result.get("effects", ())) or "none",
        "observer": "–" if entry is None else f"{entry.name} {entry.tuning}",
        "fitted": ", ".join(result.get("groups", ())) or "–",
        "error, fitted groups": _told(recording, "rms"),
        "error, held-out groups": _told(recording, "rms_validation"),
        "verdict": recording.diagnoses[-1]["verdict"] if recording.diagnoses else "–",
    }


def _rms(recording: Recording, name: str) -> float:
    """Error of the newest result over all joints [Nm]; NaN if unknown."""
    values = recording.result.get("residual", {}).get(name)
    return math.nan if values is None else total_rms(values)


def _told(recording: Recording, name: str) -> str:
    """The same in per cent of the torque and in Nm."""
    residual = recording.result.get("residual", {})
    rms = residual.get(name)
    return (
        "–"
        if rms is None
        else JointErrors(rms, residual.get("torque_spread", ()), (), residual.get("units", ())).whole()
    )


def _float(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _rank(row: ParameterDifference) -> float:
    return math.inf if math.isnan(row.deviations) else -row.deviations


def comparison_text(found: RecordingComparison) -> str:
    """The comparison as Markdown."""
    lines = [f"# {' and '.join(f'{side}: {as_markdown(r.file.name)}' for side, r in found.sides)}", ""]
    facts = ([title, *map(as_markdown, cells)] for title, cells in found.facts.items())
    lines += markdown_table(["", "A", "B"], facts)
    rows = []
    for row in sorted(found.rows, key=_rank):
        apart = "–" if math.isnan(row.deviations) else f"{number(row.deviations, 2)} standard errors"
        mark = "**" if row.deviations > NOTABLE_DEVIATIONS else ""
        place = as_markdown(row.name), as_markdown(row.joint or "")
        values = (number(value, 5) for value in row.values)
        rows.append([*place, *values, row.unit, f"{mark}{apart}{mark}"])
    if rows:
        lines += ["", *markdown_table(["parameter", "joint", "A", "B", "unit", "difference"], rows)]
    return "\n".join(lines)


def merge_recordings(found: RecordingComparison, out: Path) -> None:
    """Write both recordings and their comparison side by side: entities /A/…, /B/…, /comparison."""
    stream = rr.RecordingStream(f"{APPLICATION} comparison")
    part = hidden(out)
    with named_errors(out):
        try:
            # the layout first: the viewer shows a file while it loads
            sink = FileSink(stream, part, _blueprint(found))
            stream.send_recording_name(f"{found.a.file.stem} and {found.b.file.stem}")
            text = rr.TextDocument(comparison_text(found), media_type=rr.MediaType.MARKDOWN)
            stream.log("/comparison", text, static=True)
            sink.flush()
            for side, recording in found.sides:
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


def _blueprint(found: RecordingComparison) -> rrb.Blueprint:
    """A on the left, B on the right; both residuals of a group have the same scale."""
    sides = found.sides
    groups = list(dict.fromkeys((*found.a.groups, *found.b.groups)))
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
    rows.append(_details(found, groups))
    return page(rrb.Vertical(*rows, row_shares=[3, 2, 3] if residuals else [1, 1]), loop_mode="all")


def _residual(side: str, recording: Recording, group: str, top: float) -> rrb.TimeSeriesView:
    """The newest result's residual in one group, up to ± `top` [Nm]."""
    origin = f"/{side}" + path("results", len(recording.results), "groups", group, "residual")
    return plot(f"{side} residual [Nm] {group}", origin, ["$origin/**"], span=(-top, top))


def _details(found: RecordingComparison, groups: Sequence[str]) -> rrb.Container:
    """Differences, convergence, verdicts, descriptions, and the states of A and B overlaid."""
    curves, verdicts, about = [], [], []
    for side, r in found.sides:
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
        rrb.Tabs(*(_states(found, group) for group in groups), name="States"),
        name="Differences and more",
    )


def _states(found: RecordingComparison, group: str) -> rrb.Container:
    """All observer states of one group, B in colour over A in grey."""
    views = []
    for name in STATES:
        contents: list[str] = []
        overrides: dict[str, Any] = {}
        for side, recording in found.sides:
            for joint in recording.joints if recording.observer is not None else ():
                entity = f"/{side}" + path("observers", recording.observer, group, name, joint)
                contents.append(entity)
                if side == "A":
                    style = rr.SeriesLines(colors=rgb(COLOURS.reference), names=f"A {joint}", widths=3.0)
                    overrides[entity] = style.visualizer()
        views.append(plot(TITLES[name], "/", contents, legend=False, overrides=overrides))
    return rrb.Grid(*views, grid_columns=4, name=f"States {group}")
