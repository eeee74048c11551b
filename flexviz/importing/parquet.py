"""Read Parquet tables with any column names; a column of lists becomes one column an entry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq

from flexviz.errors import FlexvizError, InputError, one_line
from flexviz.importing.log import SHORTEST, Log, Reading, Table, as_numbers
from flexviz.measurements import Array
from flexviz.progress import Progress


def read_parquet(path: Path, reading: Reading) -> Log:
    """All columns of numbers of a Parquet table."""
    reading.progress(Progress(f"reading {path.name}", 0.0))
    with translated(path):
        with papq.ParquetFile(path) as file:
            schema = file.schema_arrow
        every = [field.name for field in schema if holds_numbers(field.type)]
        names = [name for name in every if needed(name, reading)]
        table = papq.read_table(path, columns=names)
        columns, units, unusable = columns_of(table, {})
    unusable |= {f.name: f"it holds {f.type}" for f in schema if not holds_numbers(f.type)}
    if table.num_rows < SHORTEST:
        raise InputError(f"{table.num_rows} rows, at least {SHORTEST} would be right", file=path)
    unread = tuple(name for name in every if name not in names)
    return Log(path, "Parquet", (Table("", columns, None, units),), unusable, unread=unread)


def needed(name: str, reading: Reading) -> bool:
    """Whether a column, or an entry of it, is asked for."""
    if reading.wanted is None:
        return True
    return any(w == name or w.startswith((f"{name}[", f"{name}/")) for w in reading.wanted)


def holds_numbers(kind: pa.DataType) -> bool:
    """Numbers, times, and lists of numbers."""
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind):
        return holds_numbers(kind.value_type) and not pa.types.is_temporal(kind.value_type)
    return (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_timestamp(kind)
        or pa.types.is_boolean(kind)
    )


def columns_of(
    table: pa.Table, entry_names: Mapping[str, Sequence[str]]
) -> tuple[dict[str, Array], dict[str, str], dict[str, str]]:
    """Columns as arrays, the units that their types state, and why some cannot be used.

    `entry_names` has names for the entries of columns of lists: `column/name` instead of `column[0]`.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    unusable: dict[str, str] = {}
    for name in table.column_names:
        column = table[name]
        kind = column.type
        if pa.types.is_timestamp(kind):
            column, units[name] = column.cast(pa.timestamp("ns")).cast(pa.int64()), "ns"
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
            lists = entries(column)
            if lists is None:
                unusable[name] = "its lists are not all of the same length"
                continue
            names = entry_names.get(name, ())
            for i in range(lists.shape[1]):
                entry = f"{name}/{names[i]}" if len(names) == lists.shape[1] else f"{name}[{i}]"
                columns[entry] = lists[:, i]
            continue
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
    lengths = np.array(whole.value_lengths() if not pa.types.is_fixed_size_list(whole.type) else [width])
    return flat.reshape(len(whole), width) if (lengths == width).all() else None


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """One-line InputErrors for what the library raises."""
    try:
        yield
    except FlexvizError:
        raise
    except MemoryError:
        raise InputError("the table does not fit into memory", file=path) from None
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        reason = one_line(str(getattr(error, "strerror", None) or error))[:200]
        raise InputError(f"not a readable Parquet table: {reason}", file=path) from None
