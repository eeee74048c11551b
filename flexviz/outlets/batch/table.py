"""The results of a batch as one Parquet table, a row per set, written and read."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pyarrow as pa
import pyarrow.parquet as papq

from flexviz import __version__
from flexviz.base.errors import InputError
from flexviz.base.files import write_file
from flexviz.base.limits import check_numbers, check_size
from flexviz.content.records import ParameterEstimate
from flexviz.outlets.batch.rows import FleetRow

TABLE = "results.parquet"
LARGEST_TABLE = 2**30  # [bytes]
MARK = b"flexviz"  # key of the metadata
PLACE = ("name", "joint", "payload", "group", "unit")  # of a parameter, in the metadata of its columns
ARROW: dict[Any, pa.DataType] = {
    str: pa.string(), float: pa.float64(), int: pa.int64(), bool: pa.bool_(), tuple: pa.list_(pa.string()),
    Literal: pa.string(),
}  # fmt: skip
Kinds = dict[str, pa.DataType]


def kinds_of(record: type, *but: str) -> Kinds:
    """The fields of a record with the types of their columns."""
    hints = get_type_hints(record)
    out = {}
    for field in fields(record):
        if field.name not in but:
            hint = hints[field.name]
            among = (get_origin(hint), hint, *get_args(hint))  # X, tuple[X, ...] or X | None
            out[field.name] = next(ARROW[kind] for kind in among if kind in ARROW)
    return out


PLAIN = kinds_of(FleetRow, "parameters")
PARTS = {
    "" if name == "value" else f":{name}": kind for name, kind in kinds_of(ParameterEstimate, *PLACE).items()
}  # ending of a parameter's column -> its type
DEFAULTS = {f.name: f.default for f in fields(FleetRow) if f.default is not MISSING}  # not in older tables


def write_table(rows: Sequence[FleetRow], file: Path) -> None:
    """Write the table, completely or not at all.

    Each parameter has the columns `stiffness:joint1`, `stiffness:joint1:std`, `stiffness:joint1:identifiable`
    and so on, one per field of `ParameterEstimate`; its unit is in their metadata. A set without it has null
    there.
    """
    columns = [pa.array([getattr(row, name) for row in rows], kind) for name, kind in PLAIN.items()]
    heads = [pa.field(name, kind) for name, kind in PLAIN.items()]
    units = {label: value for row in rows for label, value in row.parameters.items()}
    for label, last in units.items():
        values = [row.parameters.get(label) for row in rows]
        place = {name: getattr(last, name) for name in PLACE}
        for part, kind in PARTS.items():
            about = json.dumps({"parameter": label, "part": part, **place})
            heads.append(pa.field(label + part, kind, metadata={MARK: about.encode()}))
            name = part[1:] or "value"
            columns.append(pa.array([v and finite(getattr(v, name)) for v in values], kind))
    schema = pa.schema(heads, metadata={MARK: json.dumps({"format": 1, "flexviz": __version__}).encode()})
    write_parquet(pa.Table.from_arrays(columns, schema=schema), file)


def finite(value: Any) -> Any:
    """The value; None for a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
    for name, kind in PLAIN.items():
        if name in DEFAULTS and name not in table.schema.names:
            plain[name] = [DEFAULTS[name]] * table.num_rows
            continue
        if table.schema.field(name).type != kind:
            raise ValueError(f"column {name} has another type")
        plain[name] = [tuple(one) if isinstance(one, list) else one for one in table[name].to_pylist()]
    parameters: list[dict[str, ParameterEstimate]] = [{} for _ in range(table.num_rows)]
    for field in table.schema:
        about = json.loads((field.metadata or {}).get(MARK, b"{}"))
        if about.get("part") != "":
            continue
        label = str(about["parameter"])
        place = {"name": label.partition(":")[0], "joint": None} | {k: about[k] for k in PLACE if k in about}
        known = {part: kind for part, kind in PARTS.items() if label + part in table.schema.names}
        parts = {p[1:] or "value": table[label + p].cast(kind).to_pylist() for p, kind in known.items()}
        for row, *values in zip(parameters, *parts.values(), strict=True):
            given = {name: v for name, v in zip(parts, values, strict=True) if v is not None}
            if "value" in given:
                row[label] = ParameterEstimate(**({"std": math.nan, "identifiable": "no"} | place | given))
    return [
        FleetRow(**{name: plain[name][i] for name in PLAIN}, parameters=parameters[i])
        for i in range(table.num_rows)
    ]
