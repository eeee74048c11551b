"""Parquet tables with any column names; a column of lists becomes one column per entry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq

from flexviz.base.limits import check_numbers
from flexviz.data.logs.formats.base import Log, LogFormat, LogTable, ReadOptions, as_numbers, check_rows
from flexviz.data.measurements import Array, readable


def read_parquet(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers of a Parquet table."""
    with readable(path, "Parquet table"):
        schema = papq.read_schema(path)
        every = [field.name for field in schema if holds_numbers(field.type)]
        names = [name for name in every if options.wants(name)]
        check_parquet(path, names)
        table = papq.read_table(path, columns=names)
        columns, units, unusable = columns_of(table, {})
    check_rows(table.num_rows, path)
    unusable |= {f.name: f"it holds {f.type}" for f in schema if not holds_numbers(f.type)}
    unread = tuple(name for name in every if name not in table.column_names)
    return Log(path, "Parquet", (LogTable("", columns, None, units),), unusable, unread=unread)


def check_parquet(path: Path, names: Sequence[str]) -> None:
    """InputError if these columns take too much memory; entries of lists count, too."""
    with papq.ParquetFile(path) as table:
        about = table.metadata
        check_numbers(about.num_rows, len(names), path)
        lists = [name for name in names if is_list(table.schema_arrow.field(name).type)]
        if not lists:
            return
        table.scan_contents(lists)  # of a damaged file `column` below would end the process
        starts = tuple(f"{name}." for name in lists)  # of "positions.list.element."
        used = [j for j in range(about.num_columns) if about.schema.column(j).path.startswith(starts)]
        groups = (about.row_group(i) for i in range(about.num_row_groups))
        entries = sum(group.column(j).num_values for group in groups for j in used)
    check_numbers(entries + about.num_rows * (len(names) - len(lists)), 1, path)


def is_list(kind: pa.DataType) -> bool:
    """Lists of any kind."""
    return pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind)


def is_number(kind: pa.DataType) -> bool:
    """Types that become numbers."""
    types = pa.types
    return types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind)


def holds_numbers(kind: pa.DataType) -> bool:
    """Numbers, times, and lists of numbers."""
    return is_number(kind.value_type) if is_list(kind) else is_number(kind) or pa.types.is_timestamp(kind)


def columns_of(
    table: pa.Table, entry_names: Mapping[str, Sequence[str]]
) -> tuple[dict[str, Array], dict[str, str], dict[str, str]]:
    """Columns as arrays, the units that their types state, and why some cannot be used.

    `entry_names` names the entries of columns of lists: `column/name` instead of `column[0]`.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    unusable: dict[str, str] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if is_list(column.type):
            lists = entries(column)
            if lists is None:
                unusable[name] = "its lists are not all of the same length"
                continue
            named = [f"{name}/{entry}" for entry in entry_names.get(name, ())]
            count = lists.shape[1]
            named = named if len(named) == count else [f"{name}[{i}]" for i in range(count)]
            columns |= zip(named, lists.T, strict=True)
            continue
        if pa.types.is_timestamp(column.type):
            column, units[name] = column.cast(pa.timestamp("ns")).cast(pa.int64()), "ns"
        values = as_numbers(plain(column))
        if values is None or not np.isfinite(values).any():
            unusable[name] = "it has no values"
        else:
            columns[name] = values
    return columns, units, unusable


def plain(column: pa.ChunkedArray) -> Array:
    """(N,) the column's numbers; where values are missing, whole numbers become float with NaN."""
    if column.null_count or pa.types.is_boolean(column.type):
        column = column.cast(pa.float64(), safe=False)
    return column.to_numpy()


def entries(column: pa.ChunkedArray) -> Array | None:
    """(N, k) a column of lists; None unless every list has k numbers."""
    whole = column.combine_chunks()
    flat = as_numbers(plain(pa.chunked_array([whole.flatten()])))
    if flat is None or whole.null_count or len(whole) == 0 or len(flat) % len(whole):
        return None
    width = len(flat) // len(whole)
    if not pa.types.is_fixed_size_list(whole.type) and not (np.array(whole.value_lengths()) == width).all():
        return None
    return flat.reshape(len(whole), width)


PARQUET = LogFormat("Parquet", read_parquet, suffixes=(".parquet", ".pq"))
