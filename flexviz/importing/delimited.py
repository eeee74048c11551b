"""Read wide CSV files with any column names, separators, and with or without a header and units."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pacsv

from flexviz.errors import InputError, one_line
from flexviz.importing.log import SHORTEST, Log, Reading, Table
from flexviz.importing.parquet import columns_of
from flexviz.importing.units import known_unit
from flexviz.progress import Progress

HEAD = 1 << 16  # [bytes] that are looked at to find out how the file is written
EMPTY = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "NULL", "None", "none", "-"]
INFINITE = ("inf", "-inf", "+inf", "infinity", "-infinity")


@dataclass(frozen=True)
class Layout:
    """How a file is written: separator, decimal point, lines before the numbers, names, stated units."""

    separator: str
    decimal: str
    skip: int
    names: tuple[str, ...]
    units: dict[str, str]
    encoding: str


def read_delimited(path: Path, reading: Reading) -> Log:
    """All columns of numbers of a CSV file."""
    reading.progress(Progress(f"reading {path.name}", 0.0))
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD)
        layout = find_layout(head, path)
        spaces = layout.separator == " "
        source = pa.py_buffer(commas(path.read_bytes())) if spaces else path
        table = pacsv.read_csv(
            pa.BufferReader(source) if spaces else source,
            pacsv.ReadOptions(
                use_threads=False,
                skip_rows=layout.skip,
                column_names=list(layout.names),
                encoding=layout.encoding,
            ),
            pacsv.ParseOptions(delimiter="," if spaces else layout.separator),
            pacsv.ConvertOptions(
                null_values=EMPTY,
                strings_can_be_null=True,
                decimal_point=layout.decimal,
                include_columns=[name for name in layout.names if reading.wants(name)],
            ),
        )
    except (pa.ArrowException, OSError, ValueError, csv.Error) as error:
        if isinstance(error, InputError):
            raise
        reason = one_line(str(getattr(error, "strerror", None) or error))[:200]
        raise InputError(f"not a readable CSV table: {reason}", file=path) from None
    except MemoryError:
        raise InputError("the table does not fit into memory", file=path) from None
    if table.num_rows < SHORTEST:
        raise InputError(f"{table.num_rows} rows, at least {SHORTEST} would be right", file=path)
    texts = [
        n
        for n in table.column_names
        if pa.types.is_string(table[n].type) or pa.types.is_binary(table[n].type)
    ]
    numbers = table.drop_columns(texts + [n for n in table.column_names if pa.types.is_null(table[n].type)])
    numbers = numbers.drop_columns([n for n in numbers.column_names if not usable(numbers[n].type)])
    columns, units, unusable = columns_of(numbers, {})
    unusable |= {name: first_text(table[name], layout) for name in texts}
    unusable |= {n: "it is empty" for n in table.column_names if pa.types.is_null(table[n].type)}
    unread = tuple(name for name in layout.names if not reading.wants(name))
    return Log(path, "CSV", (Table("", columns, None, layout.units | units),), unusable, unread=unread)


def usable(kind: pa.DataType) -> bool:
    """Types that become numbers."""
    return (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_boolean(kind)
        or pa.types.is_timestamp(kind)
    )


def first_text(column: pa.ChunkedArray, layout: Layout) -> str:
    """Why a column is taken for text: its first cell that is not a number."""
    for row, cell in enumerate(column):
        text = cell.as_py()
        text = text.decode(errors="replace") if isinstance(text, bytes) else text
        if text is not None and not is_number(text, layout.decimal):
            return (
                f'row {row + 1} (line {row + 1 + layout.skip}) holds "{text[:40]}", a number would be right'
            )
    return "its numbers are written in more than one way"


def find_layout(head: bytes, path: Path) -> Layout:
    """Find out how a file is written from its beginning."""
    if head.startswith(b"PAR1"):
        raise InputError("this is a Parquet table, *.parquet would be right as its name", file=path)
    if b"\0" in head:
        raise InputError("not a text file, a CSV table would be right", file=path)
    try:
        text, encoding = head.decode("utf-8-sig", "strict" if len(head) < HEAD else "ignore"), "utf8"
    except UnicodeDecodeError:
        text, encoding = head.decode("cp1252", "replace"), "cp1252"
    lines = text.splitlines()
    lines = lines[:-1] if len(head) == HEAD else lines
    for separator, decimal in ((";", ","), (";", "."), (",", "."), ("\t", ","), ("\t", "."), (" ", ".")):
        cells = [split(line, separator) for line in lines]
        # the numbers begin where a row and the one after it are numbers, as many in both
        for i in range(len(cells) - 1):
            if (
                is_data(cells[i], decimal)
                and is_data(cells[i + 1], decimal)
                and len(cells[i]) == len(cells[i + 1])
            ):
                width = len(cells[i])
                names, units = header(cells[:i], width, path)
                return Layout(separator, decimal, i, names, units, encoding)
    raise InputError(
        "no rows of numbers were found; a header and rows of numbers, separated by commas, semicolons, tabs "
        "or spaces, would be right",
        file=path,
    )


def split(line: str, separator: str) -> list[str]:
    """The cells of a line."""
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]


def is_data(cells: list[str], decimal: str) -> bool:
    """A row of the table's body: at least two numbers, and no fewer than there are other texts."""
    filled = [cell for cell in cells if cell not in EMPTY]
    numbers = sum(is_number(cell, decimal) for cell in filled)
    return numbers >= 2 and 2 * numbers >= len(filled)


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number; with a decimal comma a point is none."""
    if decimal == ",":
        if "." in cell:
            return False
        cell = cell.replace(",", ".")
    elif "," in cell:
        return False
    if cell.strip().lower() in INFINITE:
        return True
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def header(before: list[list[str]], width: int, path: Path) -> tuple[tuple[str, ...], dict[str, str]]:
    """Names of the columns, and the units of a line of units below them."""
    rows = []
    for cells in before:
        if cells and cells[0][:1] in "#%" and cells[0] not in ("#", "%"):
            cells = [cells[0].lstrip("#% "), *cells[1:]]
        elif cells and cells[0] in ("#", "%"):
            cells = cells[1:]
        rows.append(cells)
    rows = [row for row in rows if any(row)]
    if not rows:
        return tuple(f"column{i + 1}" for i in range(width)), {}
    named = rows[-1]
    stated: list[str | None] = [None] * width
    if len(rows) > 1 and len(rows[-1]) == width == len(rows[-2]) and is_units(rows[-1]):
        named, stated = rows[-2], [known_unit(cell.strip("[]()")) for cell in rows[-1]]
    if len(named) == width - 1:
        named = ["row", *named]  # the index of a data frame, which has no name
    if len(named) != width:
        raise InputError(
            f"the header has {len(named)} names for {width} columns, one a column would be right",
            file=path,
            place="header",
        )
    names: list[str] = []
    for i, name in enumerate(named):
        name = name or f"column{i + 1}"
        names.append(name if name not in names else f"{name}#{i + 1}")
    return tuple(names), {name: unit for name, unit in zip(names, stated, strict=True) if unit}


def is_units(cells: list[str]) -> bool:
    """A line that states units: at least half of its cells are some."""
    filled = [cell.strip("[]()") for cell in cells if cell.strip("[]()- ")]
    return bool(filled) and 2 * sum(known_unit(cell) is not None for cell in filled) >= len(filled)


def commas(content: bytes) -> bytes:
    """A text with cells between spaces as one with cells between commas."""
    lines = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", content.replace(b"\r\n", b"\n"))
    return re.sub(rb"[ \t]+", b",", lines)
