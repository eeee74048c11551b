"""Read a recording's properties, results and diagnoses back from the file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
from rerun.chunk import RrdReader

from flexviz.errors import InputError

ROW = "rerun.controls.RowId"
TEXT = "TextDocument:text"
PROPERTIES = "/__properties/flexviz"
VIEW = "/__properties/view"


@dataclass(frozen=True)
class Recording:
    """A recording's properties and results; signals and motion stay in the file.

    Attributes:
        simulated: whether the measurement set was simulated.
        results: in the format of `identify --json`, with "label" and "effects" of the model; oldest first.
        diagnoses: in the format of `diagnose --json`; oldest first.
        observer: name of the last recorded observer, or None.
        eye, centre: (3,) of the view [m].
    """

    file: Path
    set_name: str
    robot: str
    simulated: bool
    joints: tuple[str, ...]
    groups: tuple[str, ...]
    results: tuple[dict[str, Any], ...]
    diagnoses: tuple[dict[str, Any], ...]
    observer: str | None = None
    eye: tuple[float, ...] | None = None
    centre: tuple[float, ...] | None = None


def read_recording(path: str | Path) -> Recording:
    """Read properties and results of an intact recording (see `check_recording`).

    Raises:
        InputError: not written by flexviz.
    """
    file = Path(path)
    properties: dict[str, Any] = {}
    texts: dict[str, tuple[bytes, str]] = {}
    observer: tuple[bytes, str | None] = (b"", None)
    for chunk in RrdReader(str(file)).stream():
        entity = chunk.entity_path
        if entity in (PROPERTIES, VIEW):
            properties |= _values(chunk.to_record_batch())
        elif entity.startswith("/observers/"):
            row = chunk.to_record_batch().column(ROW).to_pylist()[-1]
            observer = max(observer, (row, entity.split("/")[2]))
        elif entity.endswith("/json"):
            batch = chunk.to_record_batch()
            row, text = batch.column(ROW).to_pylist()[-1], batch.column(TEXT).to_pylist()[-1][0]
            texts[entity] = max(texts.get(entity, (b"", "")), (row, text))
    missing = [name for name in ("set", "robot", "simulated", "joints", "groups") if name not in properties]
    if missing:
        raise InputError(
            f"is not a flexviz recording (property {missing[0]} is missing), expected one written by "
            "`flexviz record` or the app",
            file=file,
        )
    return Recording(
        file=file,
        set_name=str(properties["set"][0]),
        robot=str(properties["robot"][0]),
        simulated=bool(properties["simulated"][0]),
        joints=tuple(properties["joints"]),
        groups=tuple(properties["groups"]),
        results=_documents(texts, "results", file),
        diagnoses=_documents(texts, "diagnoses", file),
        observer=observer[1],
        eye=tuple(properties["eye"]) if "eye" in properties else None,
        centre=tuple(properties["centre"]) if "centre" in properties else None,
    )


def _values(batch: pa.RecordBatch) -> dict[str, list[Any]]:
    return {
        name: column.to_pylist()[-1]
        for name, column in zip(batch.schema.names, batch.columns, strict=True)
        if name != ROW
    }


def _documents(texts: dict[str, tuple[bytes, str]], kind: str, file: Path) -> tuple[dict[str, Any], ...]:
    found: dict[int, dict[str, Any]] = {}
    for entity, (_, text) in texts.items():
        parts = entity.strip("/").split("/")
        if parts[0] != kind or not parts[1].isdigit():
            continue
        try:
            found[int(parts[1])] = json.loads(text)
        except ValueError as error:
            raise InputError(f"{entity} cannot be read ({error})", file=file) from None
    return tuple(found[number] for number in sorted(found))
