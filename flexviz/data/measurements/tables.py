"""Read the wanted columns of a CSV or Parquet table straight into one array.

A file streams through in blocks: the array is the only full copy of the data that ever exists.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexviz.base.errors import FlexvizError, InputError, one_line
from flexviz.base.limits import check_numbers
from flexviz.base.schemas import first_repeated
from flexviz.data.measurements.damage import CELL, RecordError, first_damage
from flexviz.data.measurements.data import Array

if TYPE_CHECKING:
    import pyarrow as pa  # loaded where a table is read: an analysis gets its set from a copy of the process

CSV_BLOCK = 1 << 20  # [bytes]
PARQUET_ROWS = 1 << 16  # rows a block
SUFFIXES = (".csv", ".parquet", ".pq")
LARGEST = 1e30  # no quantity in SI units is larger


class Table(Protocol):
    """The table of one group, in a file or in memory."""

    @property
    def file(self) -> Path:
        """What errors call it."""
        ...

    @property
    def names(self) -> list[str]:
        """Names of its columns."""
        ...

    def read(self, names: Sequence[str]) -> Array:
        """The columns `names`, checked to be finite numbers: (N, len(names)), each column contiguous."""
        ...


@dataclass(frozen=True)
class FileTable:
    """A table in a CSV or Parquet file."""

    file: Path

    @property
    def names(self) -> list[str]:
        return column_names(self.file)

    def read(self, names: Sequence[str]) -> Array:
        return read_columns(self.file, names)


def column_names(file: Path) -> list[str]:
    """Names of the columns of a table (CSV: spaces around a name do not count)."""
    import pyarrow.parquet as papq

    with readable(file, table_kind(file)):
        if is_parquet(file):
            with papq.ParquetFile(file) as table:
                names = list(table.schema_arrow.names)
        else:
            names = csv_header(file)
    if twice := first_repeated(names):
        message = f'{names.count(twice)} columns are called "{twice}", expected one'
        raise InputError(message, file=file, place="header")
    return names


def read_columns(file: Path, names: Sequence[str]) -> Array:
    """The columns `names` as a (N, len(names)) array, each column contiguous.

    Raises InputError naming file, row and column for anything that is not a finite number.
    """
    with readable(file, table_kind(file)):
        return read_parquet(file, names) if is_parquet(file) else read_csv(file, names)


def read_parquet(file: Path, names: Sequence[str]) -> Array:
    """The columns of a Parquet table (N, len(names)): a block of rows of one column at a time."""
    import pyarrow.parquet as papq

    with papq.ParquetFile(file, pre_buffer=False) as table:
        check_numbers(table.metadata.num_rows, len(names), file)
        values = np.empty((len(names), table.metadata.num_rows))
        for name, target in zip(names, values, strict=True):
            filled = 0
            for batch in table.iter_batches(PARQUET_ROWS, columns=[name], use_threads=False):
                fill(target[filled : filled + batch.num_rows], batch.column(0), name, filled, file)
                filled += batch.num_rows
    return values.T


def read_csv(file: Path, names: Sequence[str]) -> Array:
    """The columns of a CSV table (N, len(names)): a block of rows at a time."""
    import pyarrow as pa

    rows = most_csv_rows(file)
    check_numbers(rows, len(names), file)
    values = np.empty((len(names), rows))
    filled = 0
    try:
        for batch in csv_blocks(file, names):
            block = values[:, filled : filled + batch.num_rows]
            for index, name in enumerate(names):
                fill(block[index], batch.column(index), name, filled, file)
            filled += batch.num_rows
    except pa.ArrowInvalid:
        explain_csv(file, names)
        raise
    if filled < rows:
        # give the unused end back (the number of rows of a CSV was only known from above)
        values = values[:, :filled] if filled > 0.9 * rows else values[:, :filled].copy()
    return values.T


def fill(target: Array, column: pa.Array, name: str, offset: int, file: Path) -> None:
    """Copy a block of one column into `target` (M,), refusing empty cells, NaN and infinity."""
    from pyarrow import types

    def refuse(row: int, message: str) -> None:
        raise InputError(message, file=file, place=f"row {row_name(file, row + offset)}, column {name}")

    if not (types.is_floating(column.type) or types.is_integer(column.type) or types.is_null(column.type)):
        message = f"the column holds {column.type}, expected numbers"
        raise InputError(message, file=file, place=f"column {name}")
    if column.null_count:
        empty = column.is_null().to_numpy(zero_copy_only=False)
        refuse(int(np.argmax(empty)), "the cell is empty, expected a number")
    if len(column):  # `to_numpy` would import pandas where it is installed: 30 MB, .3 s
        kind = np.dtype(column.type.to_pandas_dtype())
        target[:] = np.frombuffer(column.buffers()[1], kind, len(column), column.offset * kind.itemsize)
    require_finite(target, name, file, offset)


def require_finite(column: Array, name: str, file: Path, offset: int = 0) -> None:
    """InputError for NaN, infinity and impossible sizes in a column (M,), which begins at row `offset`."""
    usable = np.abs(column) < LARGEST  # False for NaN
    if not usable.all():
        bad = int(np.argmin(usable))
        expected = "a number in SI units" if np.isfinite(column[bad]) else "a finite number"
        message = f"found {column[bad]:g}, expected {expected}"
        raise InputError(message, file=file, place=f"row {row_name(file, bad + offset)}, column {name}")


def row_name(file: Path, row: int) -> str:
    """A data row (counted from 0) as messages call it: from 1, with a CSV's line, an array's index."""
    also = {".csv": f" (line {row + 2})", "": f" (index {row})"}
    return f"{row + 1}{also.get(file.suffix.lower(), '')}"


def is_parquet(file: Path) -> bool:
    """Whether a table is Parquet (else it is CSV), by its suffix."""
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"a table called *{suffix} is not known, expected *.csv or *.parquet", file=file)
    return suffix != ".csv"


def table_kind(file: Path) -> str:
    """The kind of a table as messages call it."""
    return "Parquet table" if is_parquet(file) else "CSV table"


@contextmanager
def readable(file: Path, kind: str) -> Iterator[None]:
    """One-line InputErrors for whatever a damaged file of this kind makes the libraries raise."""
    try:
        yield
    except FlexvizError:
        raise
    except UnicodeDecodeError:
        raise InputError(f"not a readable {kind}: not a text in UTF-8: save it as one", file=file) from None
    except MemoryError:
        raise InputError(f"the {kind} does not fit into memory", file=file) from None
    except Exception as error:  # struct, zlib, sqlite, yaml, Arrow and decoding errors of every kind
        reason = one_line(str(getattr(error, "strerror", None) or error) or type(error).__name__)[:200]
        cut = file.suffix == ".mcap" and ("magic" in reason or "Truncated" in reason)
        hint = "; an MCAP file cut short is repaired by `mcap recover`" if cut else ""
        raise InputError(f"not a readable {kind}: {reason}{hint}", file=file) from None


def csv_header(file: Path) -> list[str]:
    """The names in the first line (spaces around a name do not count)."""
    with file.open("rb") as stream:
        line = stream.readline(CSV_BLOCK)
    if line.startswith(b"PAR1"):
        raise InputError("this is a Parquet table, expected *.parquet as its name", file=file)
    if not line:
        raise InputError("the file is empty, expected a header and rows of numbers", file=file)
    text = line.decode("utf-8-sig").splitlines()[0] if line.strip() else ""
    names = [name.strip() for name in next(csv.reader([text], skipinitialspace=True), [])]
    if len(names) <= 1 and (";" in text or "\t" in text):
        raise InputError("the columns are not separated by commas", file=file, place="header")
    return names


def most_csv_rows(file: Path) -> int:
    """Upper bound of the number of rows: the number of line ends."""
    ends = returns = 0
    with file.open("rb") as stream:
        while block := stream.read(CSV_BLOCK):
            ends += block.count(b"\n")
            returns += 0 if ends else block.count(b"\r")
    return max(ends, returns) + 1


def csv_blocks(file: Path, names: Sequence[str]) -> Iterator[pa.RecordBatch]:
    """Blocks of rows with the columns in the order of `names`."""
    import pyarrow as pa
    import pyarrow.csv as pacsv

    reading = pacsv.ReadOptions(
        use_threads=False, block_size=CSV_BLOCK, skip_rows=1, column_names=csv_header(file)
    )
    conversion = pacsv.ConvertOptions(  # only an empty cell is empty; "nan" is NaN and refused later
        include_columns=list(names),
        column_types=dict.fromkeys(names, pa.float64()),
        null_values=[""],
        strings_can_be_null=True,
    )
    with pacsv.open_csv(file, read_options=reading, convert_options=conversion) as reader:
        yield from reader


def explain_csv(file: Path, names: Sequence[str]) -> None:
    """InputError that names the first row that could not be read."""
    header = csv_header(file)

    def check(text: str, ended: bool) -> None:
        cells = [cell.strip().strip('"') for cell in text.split(",")]
        if len(cells) != len(header):
            raise RecordError(f"{len(cells)} values for {len(header)} columns", "one per column")
        for name in names:
            if not is_number(cell := cells[header.index(name)]):
                raise RecordError(f'"{cell[:40]}"', "a number", name, CELL)

    with file.open("rb") as stream:
        if damage := first_damage(stream, check, skip=1):
            raise damage.error(file)


def is_number(cell: str) -> bool:
    """Whether a CSV cell holds a number."""
    try:
        float(cell or "0")
    except ValueError:
        return False
    return True


def require(names: Sequence[str], wanted: Sequence[str], file: Path) -> None:
    """InputError for the first of the `wanted` columns that is not there."""
    missing = [name for name in wanted if name not in names]
    if missing:
        others = f" (also {', '.join(missing[1:20])})" if len(missing) > 1 else ""
        guess = get_close_matches(missing[0], [name for name in names if name not in wanted], 1, 0.8)
        meant = f' did you mean "{guess[0]}"?' if guess else ""
        found = ", ".join(names[:20]) + (", …" if len(names) > 20 else "")
        message = f'column "{missing[0]}" is missing{others};{meant} the table has {found}'
        raise InputError(message, file=file, place="header")
