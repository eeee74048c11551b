"""The results of a batch as one Parquet table, a row per set, written and read."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as papq

from flexviz import __version__
from flexviz.batch.rows import FleetRow, FleetValue
from flexviz.errors import InputError
from flexviz.files import write_file
from flexviz.limits import check_numbers, check_size

TABLE = "results.parquet"
LARGEST_TABLE = 2**30  # [bytes]
PARTS = {"": pa.float64(), ":std": pa.float64(), ":identifiable": pa.string()}  # of a parameter's columns
MARK = b"flexviz"  # key of the metadata
KINDS: dict[str, pa.DataType] = {
    "confidence": pa.float64(),
    "residual": pa.float64(),
    "residual_before": pa.float64(),
    "converged": pa.bool_(),
    "seconds": pa.float64(),
    "found": pa.list_(pa.string()),
    "families": pa.list_(pa.string()),
}  # all others are texts
ADDED_LATER = ("families",)  # columns that earlier versions did not write
PLAIN = tuple(field.name for field in fields(FleetRow) if field.name != "parameters")


def write_table(rows: Sequence[FleetRow], file: Path) -> None:
    """Write the table, completely or not at all.

    Each parameter has the columns `stiffness:joint1`, `stiffness:joint1:std` and
    `stiffness:joint1:identifiable`; its unit is in their metadata. A set without it has null there.
    """
    columns: list[pa.Array] = []
    heads: list[pa.Field] = []
    for name in PLAIN:
        kind = KINDS.get(name, pa.string())
        heads.append(pa.field(name, kind))
        columns.append(pa.array([getattr(row, name) for row in rows], kind))
    units = {label: value.unit for row in rows for label, value in row.parameters.items()}
    for label, unit in units.items():
        values = [row.parameters.get(label) for row in rows]
        parts = {
            "": [v and v.value for v in values],
            ":std": [v and v.std for v in values],
            ":identifiable": [v and v.identifiable for v in values],
        }
        for part, kind in PARTS.items():
            about = json.dumps({"parameter": label, "part": part, "unit": unit})
            heads.append(pa.field(label + part, kind, metadata={MARK: about.encode()}))
            columns.append(pa.array(parts[part], kind))
    schema = pa.schema(heads, metadata={MARK: json.dumps({"format": 1, "flexviz": __version__}).encode()})
    write_parquet(pa.Table.from_arrays(columns, schema=schema), file)


def write_parquet(table: pa.Table, file: Path) -> None:
    """Write a table, completely or not at all."""
    buffer = io.BytesIO()
    papq.write_table(table, buffer, compression="zstd")
    write_file(file, buffer.getvalue())


def read_table(file: Path) -> list[FleetRow]:
    """The rows of a table that `write_table` wrote; InputError for any other file."""
    try:
        check_size(file, LARGEST_TABLE, "a table of results")
        with papq.ParquetFile(file) as source:
            check_numbers(source.metadata.num_rows, source.metadata.num_columns, file)
            table = source.read()
    except (OSError, pa.ArrowException) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read ({reason})", file=file) from None
    try:
        return _rows(table)
    except (KeyError, TypeError, ValueError, pa.ArrowException) as error:
        message = (
            f"not a table of results, expected what `flexviz batch` writes ({type(error).__name__}: {error})"
        )
        raise InputError(message, file=file) from None


def _rows(table: pa.Table) -> list[FleetRow]:
    if MARK not in (table.schema.metadata or {}):
        raise ValueError("no mark of flexviz")
    plain: dict[str, list[Any]] = {}
    for name in PLAIN:
        kind = KINDS.get(name, pa.string())
        if name in ADDED_LATER and name not in table.schema.names:
            plain[name] = [None] * table.num_rows
            continue
        if table.schema.field(name).type != kind:
            raise ValueError(f"column {name} has another type")
        plain[name] = table[name].to_pylist()
    for name in ("found", "families"):
        plain[name] = [tuple(one or ()) for one in plain[name]]
    parameters: list[dict[str, FleetValue]] = [{} for _ in range(table.num_rows)]
    for field in table.schema:
        about = json.loads((field.metadata or {}).get(MARK, b"{}"))
        if about.get("part") != "":
            continue
        label = str(about["parameter"])
        value, std, grade = (table[label + part].cast(kind).to_pylist() for part, kind in PARTS.items())
        for row, v, s, g in zip(parameters, value, std, grade, strict=True):
            if v is not None:
                row[label] = FleetValue(v, s, str(about["unit"]), g or "")
    return [
        FleetRow(**{name: plain[name][i] for name in PLAIN}, parameters=parameters[i])
        for i in range(table.num_rows)
    ]
