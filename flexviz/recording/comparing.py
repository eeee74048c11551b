"""Compare the newest results of two recordings, and merge both side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader

from flexviz.charts import COLOURS, rgb
from flexviz.recording.layout import document, page, plot, scene_view
from flexviz.recording.paths import (
    APPLICATION,
    STATES,
    TITLES,
    diagnosis_path,
    observer_path,
    result_path,
)
from flexviz.recording.reading import Recording
from flexviz.recording.texts import table
from flexviz.results import bandwidth_text
from flexviz.view import total_rms
from flexviz.wording import as_markdown, number

SIDES = ("A", "B")
SCALARS = "Scalars:scalars"
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
    def notable(self) -> list[ParameterDifference]:
        """Parameters that differ by more than `NOTABLE_DEVIATIONS`, largest difference first."""
        return [row for row in sorted(self.rows, key=_rank) if row.deviations > NOTABLE_DEVIATIONS]


def compare_recordings(a: Recording, b: Recording) -> RecordingComparison:
    """Compare the newest results of two recordings."""
    results = [recording.results[-1] if recording.results else {} for recording in (a, b)]
    tables = [{_key(p): p for p in result.get("parameters", ())} for result in results]
    rows = tuple(
        ParameterDifference(
            key[0], key[1], one.get("unit", ""), _pair(tables, key, "value"), _pair(tables, key, "std")
        )
        for key, one in (tables[0] | tables[1]).items()
    )
    errors = [result.get("residual", {}) for result in results]
    rms, rms_validation = (_both(_total(e.get(name)) for e in errors) for name in ("rms", "rms_validation"))
    facts = {
        "set": (a.set_name, b.set_name),
        "model": _both(result.get("label") or "–" for result in results),
        "effects": _both(", ".join(result.get("effects", ())) or "none" for result in results),
        "observer": _both(_observer(result.get("observer", {})) for result in results),
        "fitted": _both(", ".join(result.get("groups", ())) or "–" for result in results),
        "rms fit [Nm]": _both(number(value, 4) for value in rms),
        "rms validation [Nm]": _both(number(value, 4) for value in rms_validation),
        "verdict": _both(r.diagnoses[-1]["verdict"] if r.diagnoses else "–" for r in (a, b)),
    }
    return RecordingComparison(a, b, rows, rms, facts)


def comparison_text(found: RecordingComparison) -> str:
    """The comparison as Markdown."""
    names = [f"{side}: {as_markdown(r.file.name)}" for side, r in zip(SIDES, (found.a, found.b), strict=True)]
    lines = [f"# {names[0]} and {names[1]}", ""]
    lines += table(
        ["", "A", "B"], ([title, *map(as_markdown, cells)] for title, cells in found.facts.items())
    )
    rows = []
    for row in sorted(found.rows, key=_rank):
        apart = "–" if math.isnan(row.deviations) else f"{number(row.deviations, 2)} standard errors"
        mark = "**" if row.deviations > NOTABLE_DEVIATIONS else ""
        values = (number(value, 5) for value in row.values)
        rows.append(
            [
                as_markdown(row.name),
                as_markdown(row.joint or ""),
                *values,
                row.unit,
                f"{mark}{apart}{mark}",
            ]
        )
    if rows:
        lines += ["", *table(["parameter", "joint", "A", "B", "unit", "difference"], rows)]
    return "\n".join(lines)


def merge_recordings(found: RecordingComparison, out: Path) -> None:
    """Write both recordings and their comparison side by side: entities /A/…, /B/…, /comparison."""
    recordings = (found.a, found.b)
    largest: dict[str, float] = {}
    for recording in recordings:
        for group, value in _largest_residuals(recording).items():
            largest[group] = max(largest.get(group, 0.0), value)
    stream = rr.RecordingStream(f"{APPLICATION} comparison")
    # the layout first: the viewer shows a file while it loads
    stream.save(out, default_blueprint=_blueprint(recordings, largest))
    stream.send_recording_name(f"{found.a.file.stem} and {found.b.file.stem}")
    text = rr.TextDocument(comparison_text(found), media_type=rr.MediaType.MARKDOWN)
    stream.log("/comparison", text, static=True)
    stream.flush()
    for side, recording in zip(SIDES, recordings, strict=True):
        chunks = RrdReader(str(recording.file)).stream().drop(content="/__properties/**")
        stream.send_chunks(chunks.map(partial(_under, f"/{side}")))
    stream.flush()
    stream.disconnect()


def _largest_residuals(recording: Recording) -> dict[str, float]:
    """Group -> largest residual of the newest result [Nm]."""
    found: dict[str, float] = {}
    for group in recording.groups:
        where = result_path(len(recording.results), "groups", group, "residual")
        values = [
            float(np.nanmax(np.abs(np.asarray(batch.column(SCALARS).flatten(), dtype=float)), initial=0.0))
            for chunk in RrdReader(str(recording.file)).stream().filter(content=f"{where}/**")
            if SCALARS in (batch := chunk.to_record_batch()).schema.names
        ]
        if values:
            found[group] = max(values)
    return found


# -- the layout ----------------------------------------------------------------------------------------------


def _blueprint(recordings: Sequence[Recording], largest: dict[str, float]) -> rrb.Blueprint:
    """A on the left, B on the right; both sides are scaled by `largest`: group -> largest residual [Nm]."""
    groups = list(dict.fromkeys(group for recording in recordings for group in recording.groups))
    sides = list(zip(SIDES, recordings, strict=True))
    scenes = [
        rrb.Horizontal(
            *(scene_view(f"/{side}", f"{side} 3D {group}", group, r.eye, r.centre) for side, r in sides),
            name=f"3D {group}",
        )
        for group in groups
    ]
    residuals = [
        rrb.Horizontal(
            *(_residual(side, recording, group, largest[group]) for side, recording in sides),
            name=f"Where it fails {group}",
        )
        for group in groups
        if group in largest
    ]
    rows: Views = [rrb.Tabs(*scenes, name="3D")]
    if residuals:
        rows.append(rrb.Tabs(*residuals, name="Where it fails"))
    rows.append(_details(sides, groups))
    return page(rrb.Vertical(*rows, row_shares=[3, 2, 3] if residuals else [1, 1]), loop_mode="all")


def _residual(side: str, recording: Recording, group: str, largest: float) -> rrb.TimeSeriesView:
    """The newest result's residual in one group."""
    origin = f"/{side}" + result_path(len(recording.results), "groups", group, "residual")
    top = 1.05 * largest or 1.0
    return plot(f"{side} residual [Nm] {group}", origin, ["$origin/**"], span=(-top, top))


def _details(sides: Sequence[tuple[str, Recording]], groups: Sequence[str]) -> rrb.Container:
    """Differences, convergence, verdicts, descriptions, and the states of A and B overlaid."""
    views: Views = [document("/comparison", "Differences")]
    curves = [
        plot(
            f"{side} {name}",
            f"/{side}" + result_path(len(r.results), "optimiser"),
            [f"$origin/{entity}"],
            legend=False,
        )
        for side, r in sides
        if r.results
        for name, entity in (("cost, log10", "log10_cost"), ("parameters / last value", "relative"))
    ]
    if curves:
        views.append(rrb.Horizontal(*curves, name="Convergence"))
    verdicts = [
        document(f"/{side}" + diagnosis_path(len(r.diagnoses), "verdict"), f"{side} verdict")
        for side, r in sides
        if r.diagnoses
    ]
    if verdicts:
        views.append(rrb.Horizontal(*verdicts, name="Verdicts"))
    views.append(
        rrb.Horizontal(*(document(f"/{side}/about", f"{side} about") for side, _ in sides), name="About")
    )
    views.append(rrb.Tabs(*(_states(sides, group) for group in groups), name="States"))
    return rrb.Tabs(*views, name="Differences and more")


def _states(sides: Sequence[tuple[str, Recording]], group: str) -> rrb.Container:
    """All observer states of one group, B in colour over A in grey."""
    views = []
    for name in STATES:
        contents: list[str] = []
        overrides: dict[str, Any] = {}
        for side, recording in sides:
            for joint in recording.joints if recording.observer is not None else ():
                entity = f"/{side}" + observer_path(recording.observer, group, name, joint)
                contents.append(entity)
                if side == SIDES[0]:
                    style = rr.SeriesLines(colors=rgb(COLOURS.reference), names=f"A {joint}", widths=3.0)
                    overrides[entity] = style.visualizer()
        views.append(plot(TITLES[name], "/", contents, legend=False, overrides=overrides))
    return rrb.Grid(*views, grid_columns=4, name=f"States {group}")


# -- parts ---------------------------------------------------------------------------------------------------


def _under(prefix: str, chunk: Chunk) -> Chunk:
    return chunk.with_entity_path(prefix + chunk.entity_path)


def _key(parameter: dict[str, Any]) -> tuple[str, str | None, str | None, str | None]:
    return (parameter["name"], parameter["joint"], parameter.get("payload"), parameter.get("group"))


def _pair(tables: list[dict[Any, dict[str, Any]]], key: Any, name: str) -> tuple[float, float]:
    values = (table.get(key, {}).get(name) for table in tables)
    return _both(math.nan if value is None else float(value) for value in values)


def _rank(row: ParameterDifference) -> float:
    return math.inf if math.isnan(row.deviations) else -row.deviations


def _total(rms: list[float] | None) -> float:
    return math.nan if rms is None else total_rms(np.asarray(rms))


def _observer(observer: dict[str, Any]) -> str:
    bandwidth = observer.get("bandwidth")
    return f"{observer.get('name', '–')} {'' if bandwidth is None else bandwidth_text(bandwidth)}"


def _both(values: Iterable[Any]) -> tuple[Any, Any]:
    a, b = values
    return a, b
