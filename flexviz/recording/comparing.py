"""Two recordings held against each other: their newest results in numbers, and both in one recording."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from flexviz.recording.compare_layout import compare_blueprint
from flexviz.recording.paths import APPLICATION, result_path
from flexviz.recording.reading import Recording
from flexviz.recording.texts import escaped
from flexviz.view import total_rms
from flexviz.wording import number

SIDES = ("A", "B")
SCALARS = "Scalars:scalars"
NOTABLE = 3.0  # standard errors


@dataclass(frozen=True)
class Row:
    """One parameter in both; NaN where one of them does not have it.

    Attributes
    ----------
    name, joint, unit: which one.
    values, stds: in A and in B [unit].
    deviations: their difference in standard errors of the difference; NaN where that is not known.
    """

    name: str
    joint: str | None
    unit: str
    values: tuple[float, float]
    stds: tuple[float, float]

    @property
    def deviations(self) -> float:
        spread = math.hypot(*self.stds)
        difference = abs(self.values[0] - self.values[1])
        if math.isnan(difference) or math.isnan(spread):
            return math.nan
        return difference / spread if spread > 0 else (0.0 if difference == 0 else math.inf)


@dataclass(frozen=True)
class Comparison:
    """The newest results of two recordings.

    Attributes
    ----------
    a, b: the recordings.
    rows: every parameter that at least one of them has.
    rms, rms_validation: root of the mean square over the joints [Nm], in A and B; NaN where there is none.
    only: effects that only A has, and that only B has.
    """

    a: Recording
    b: Recording
    rows: tuple[Row, ...]
    rms: tuple[float, float]
    rms_validation: tuple[float, float]
    only: tuple[tuple[str, ...], tuple[str, ...]]

    @property
    def notable(self) -> list[Row]:
        """The parameters that differ by more than chance would, the largest difference first."""
        return [row for row in sorted(self.rows, key=_rank) if row.deviations > NOTABLE]


def compare(a: Recording, b: Recording) -> Comparison:
    """Hold the newest results of two recordings against each other."""
    results = [recording.results[-1] if recording.results else {} for recording in (a, b)]
    tables = [{_key(p): p for p in result.get("parameters", ())} for result in results]
    rows = tuple(
        Row(key[0], key[1], one.get("unit", ""), _pair(tables, key, "value"), _pair(tables, key, "std"))
        for key, one in (tables[0] | tables[1]).items()
    )
    residuals = [result.get("residual", {}) for result in results]
    effects = [set(result.get("effects", ())) for result in results]
    first, second = (
        tuple(sorted(mine - other)) for mine, other in ((effects[0], effects[1]), (effects[1], effects[0]))
    )
    return Comparison(
        a,
        b,
        rows,
        rms=_both(_total(residual.get("rms")) for residual in residuals),
        rms_validation=_both(_total(residual.get("rms_validation")) for residual in residuals),
        only=(first, second),
    )


def comparison_text(found: Comparison) -> str:
    """The comparison as Markdown."""
    names = [f"{side}: {escaped(r.file.name)}" for side, r in zip(SIDES, (found.a, found.b), strict=True)]
    lines = [f"# {names[0]} and {names[1]}", "", "| | A | B |", "|---|---|---|"]
    for title, cells in facts(found):
        lines.append(f"| {title} | {escaped(cells[0])} | {escaped(cells[1])} |")
    if found.rows:
        lines += ["", "| parameter | joint | A | B | unit | difference |", "|---|---|---|---|---|---|"]
        for row in sorted(found.rows, key=_rank):
            apart = "–" if math.isnan(row.deviations) else f"{number(row.deviations, 2)} standard errors"
            mark = "**" if row.deviations > NOTABLE else ""
            a, b = (number(value, 5) for value in row.values)
            lines.append(
                f"| {escaped(row.name)} | {escaped(row.joint or '')} | {a} | {b} | {row.unit} | "
                f"{mark}{apart}{mark} |"
            )
    return "\n".join(lines)


def facts(found: Comparison) -> list[tuple[str, tuple[str, str]]]:
    """What there is to know of each beside the parameters: title, and what stands for A and for B."""

    def of(recording: Recording) -> dict[str, Any]:
        return recording.results[-1] if recording.results else {}

    a, b = of(found.a), of(found.b)
    observers = [result.get("observer", {}) for result in (a, b)]
    out = [
        ("set", (found.a.set_name, found.b.set_name)),
        ("model", (a.get("label") or "–", b.get("label") or "–")),
        ("effects", _both(", ".join(result.get("effects", ())) or "none" for result in (a, b))),
        ("observer", _both(f"{o.get('name', '–')} {_bandwidth(o.get('bandwidth'))}" for o in observers)),
        ("fitted", _both(", ".join(result.get("groups", ())) or "–" for result in (a, b))),
        ("rms fit [Nm]", _both(number(value, 4) for value in found.rms)),
        ("rms validation [Nm]", _both(number(value, 4) for value in found.rms_validation)),
    ]
    verdicts = [r.diagnoses[-1]["verdict"] if r.diagnoses else "–" for r in (found.a, found.b)]
    return [*out, ("verdict", _both(verdicts))]


def merge(found: Comparison, out: Path) -> None:
    """Write both recordings and their comparison in one, side by side: entities /A/…, /B/…, /comparison."""
    recordings = (found.a, found.b)
    largest: dict[str, float] = {}
    for recording in recordings:
        for group, value in largest_residuals(recording).items():
            largest[group] = max(largest.get(group, 0.0), value)
    stream = rr.RecordingStream(f"{APPLICATION} comparison")
    # first of all the layout: the viewer shows a file while it loads
    stream.save(out, default_blueprint=compare_blueprint(recordings, largest))
    stream.send_recording_name(f"{found.a.file.stem} and {found.b.file.stem}")
    text = rr.TextDocument(comparison_text(found), media_type=rr.MediaType.MARKDOWN)
    stream.log("/comparison", text, static=True)
    stream.flush()
    for side, recording in zip(SIDES, recordings, strict=True):
        chunks = RrdReader(str(recording.file)).stream().drop(content="/__properties/**")
        stream.send_chunks(chunks.map(partial(_under, f"/{side}")))
    stream.flush()
    stream.disconnect()


def largest_residuals(recording: Recording) -> dict[str, float]:
    """Group -> the largest residual of the newest result [Nm]."""
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


def _under(prefix: str, chunk: Chunk) -> Chunk:
    return chunk.with_entity_path(prefix + chunk.entity_path)


def _key(parameter: dict[str, Any]) -> tuple[str, str | None, str | None, str | None]:
    return (parameter["name"], parameter["joint"], parameter.get("payload"), parameter.get("group"))


def _pair(tables: list[dict[Any, dict[str, Any]]], key: Any, name: str) -> tuple[float, float]:
    values = (table.get(key, {}).get(name) for table in tables)
    return _both(math.nan if value is None else float(value) for value in values)


def _rank(row: Row) -> float:
    return math.inf if math.isnan(row.deviations) else -row.deviations


def _total(rms: list[float] | None) -> float:
    return math.nan if rms is None else total_rms(np.asarray(rms))


def _bandwidth(value: float | list[float] | None) -> str:
    if value is None:
        return ""
    return ", ".join(f"{w:.4g}" for w in np.atleast_1d(value)) + " rad/s"


def _both(values: Iterable[Any]) -> tuple[Any, Any]:
    a, b = values
    return a, b
