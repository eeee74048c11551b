"""Wide CSV files with any column names and separators, with or without a header and units."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pacsv

from flexviz.errors import InputError
from flexviz.importing.column_names import known_unit
from flexviz.importing.formats.base import Log, LogFormat, LogTable, ReadOptions, check_rows
from flexviz.importing.formats.frames import read_frames
from flexviz.importing.formats.parquet import columns_of, is_number
from flexviz.importing.formats.twincat import scope_header, with_one_clock
from flexviz.measurements import readable

HEAD = 1 << 16  # [bytes] from which the layout is found
EMPTY = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "NULL", "None", "none", "-"]
# separator, decimal point
LAYOUTS = ((";", ","), (";", "."), (",", "."), ("\t", ","), ("\t", "."), (" ", "."))


@dataclass(frozen=True)
class CsvLayout:
    """How a file is written: separator, decimal point, lines before the numbers, names, stated units."""

    separator: str
    decimal: str
    skip: int
    names: list[str]
    units: dict[str, str]
    encoding: str
    scope: bool = False  # an export of TwinCAT Scope, whose channels have times of their own


def read_delimited(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers of a CSV file."""
    with readable(path, "CSV table"):
        with path.open("rb") as stream:
            head = stream.read(HEAD)
        if b"<Rob" in head:
            return read_frames(path, options)
        layout = find_layout(head, path)
        end = end_of_whole_rows(path, layout)
        wanted = [name for name in layout.names if layout.scope or options.wants(name)]
        table = read_table(path, layout, wanted, end)
    check_rows(table.num_rows, path)
    kinds = {field.name: field.type for field in table.schema}
    usable = [name for name, kind in kinds.items() if is_number(kind) or pa.types.is_timestamp(kind)]
    columns, units, unusable = columns_of(table.select(usable), {})
    for name, kind in kinds.items():
        if pa.types.is_null(kind):
            unusable[name] = "it is empty"
        elif pa.types.is_string(kind) or pa.types.is_binary(kind):
            unusable[name] = first_text(table[name], layout)
    unread = tuple(name for name in layout.names if name not in table.column_names)
    columns = with_one_clock(columns) if layout.scope else columns
    notes = () if end is None else ("the last line is cut off and left out",)
    columns_here = LogTable("", columns, None, layout.units | units)
    return Log(path, "CSV", (columns_here,), unusable, notes, unread)


def end_of_whole_rows(path: Path, layout: CsvLayout) -> int | None:
    """Where a last line begins that was cut off [bytes]; None where it is complete.

    Cut off: fewer cells than columns, or no number where the line before has one, and no end of line.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        stream.seek(max(0, size - HEAD))
        tail = stream.read()
    if tail.endswith((b"\n", b"\r")):
        return None
    lines = [line for line in tail.splitlines() if line.strip()]
    if len(lines) < 2:
        return None
    before, last = (split(line.decode("utf-8", "replace"), layout.separator) for line in lines[-2:])
    if len(before) != len(layout.names):
        return None
    pairs = zip(before, last, strict=False)
    broken = any(is_numeral(b, layout.decimal) and not is_numeral(c, layout.decimal) for b, c in pairs)
    return size - len(lines[-1]) if broken or len(last) < len(before) else None


def read_table(path: Path, layout: CsvLayout, names: list[str], end: int | None) -> pa.Table:
    """The columns `names` of a file, up to its byte `end`."""
    spaces = layout.separator == " "
    content = path.read_bytes()[:end] if spaces or end is not None else None
    return pacsv.read_csv(
        path if content is None else pa.BufferReader(commas(content) if spaces else content),
        pacsv.ReadOptions(
            use_threads=False, skip_rows=layout.skip, column_names=layout.names, encoding=layout.encoding
        ),
        pacsv.ParseOptions(delimiter="," if spaces else layout.separator),
        pacsv.ConvertOptions(
            null_values=EMPTY, strings_can_be_null=True, decimal_point=layout.decimal, include_columns=names
        ),
    )


def first_text(column: pa.ChunkedArray, layout: CsvLayout) -> str:
    """Why a column is taken for text: its first cell that is not a number."""
    for row, cell in enumerate(column):
        text = cell.as_py()
        text = text.decode(errors="replace") if isinstance(text, bytes) else text
        if text is not None and not is_numeral(text, layout.decimal):
            return f'row {row + 1} (line {row + 1 + layout.skip}) holds "{text[:40]}", expected a number'
    return "its numbers are written in more than one way"


def find_layout(head: bytes, path: Path) -> CsvLayout:
    """The layout of a file, from its beginning."""
    if head.startswith(b"PAR1"):
        raise InputError("this is a Parquet table, expected *.parquet as its name", file=path)
    if b"\0" in head:
        raise InputError("not a text file, expected a CSV table", file=path)
    try:
        text, encoding = head.decode("utf-8-sig", "strict" if len(head) < HEAD else "ignore"), "utf8"
    except UnicodeDecodeError:
        text, encoding = head.decode("cp1252", "replace"), "cp1252"
    lines = text.splitlines()
    lines = lines[:-1] if len(head) == HEAD else lines
    if (scope := scope_header(lines, split)) is not None:
        separator, skip, names, units = scope
        decimal = "," if separator != "," and any("," in line for line in lines[skip:]) else "."
        return CsvLayout(separator, decimal, skip, names, units, encoding, scope=True)
    for separator, decimal in LAYOUTS:
        rows = [(i, split(line, separator)) for i, line in enumerate(lines) if line.strip()]
        # the numbers begin at the first two successive rows of equally many of them
        for (i, row), (_, after) in pairwise(rows):
            if len(row) == len(after) and is_data(row, decimal) and is_data(after, decimal):
                names, units = header([cells for k, cells in rows if k < i], len(row), path)
                return CsvLayout(separator, decimal, i, names, units, encoding)
    cells = [line.strip() for line in lines if line.strip()]
    if len(cells) > 1 and all(is_numeral(cell, ".") for cell in cells[1:]):
        message = (
            "each row holds one number, expected at least two columns; arrays in files of their own, also "
            "with the values of several joints in one column, can be read from one .npz"
        )
        raise InputError(message, file=path)
    expected = "expected a header and rows of numbers, separated by commas, semicolons, tabs or spaces"
    raise InputError(f"no rows of numbers were found, {expected}", file=path)


def split(line: str, separator: str) -> list[str]:
    """The cells of a line."""
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]


def is_data(cells: list[str], decimal: str) -> bool:
    """A row of the table's body: at least two numbers, and no more texts than numbers."""
    filled = [cell for cell in cells if cell not in EMPTY]
    numbers = sum(is_numeral(cell, decimal) for cell in filled)
    return numbers >= 2 and 2 * numbers >= len(filled)


def is_numeral(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number with this decimal point."""
    if "_" in cell or (decimal == "," and "." in cell) or (decimal == "." and "," in cell):
        return False
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def header(before: list[list[str]], width: int, path: Path) -> tuple[list[str], dict[str, str]]:
    """Names of the columns, and the units of a line of units below them."""
    rows = []
    for cells in before:
        if cells and cells[0] in ("#", "%"):
            cells = cells[1:]
        elif cells:
            cells = [cells[0].lstrip("#% ") if cells[0][:1] in "#%" else cells[0], *cells[1:]]
        if any(cells):
            rows.append(cells)
    if not rows:
        return [f"column{i + 1}" for i in range(width)], {}
    named = rows[-1]
    stated: list[str | None] = [None] * width
    if len(rows) > 1 and len(rows[-1]) == width == len(rows[-2]):
        units = [known_unit(cell.strip("[]()")) for cell in rows[-1]]
        filled = sum(bool(cell.strip("[]()- ")) for cell in rows[-1])
        if filled and 2 * sum(unit is not None for unit in units) >= filled:  # a line of units
            named, stated = rows[-2], units
    if len(named) == width - 1:
        named = ["row", *named]  # the index of a data frame, which has no name
    if len(named) != width:
        message = f"the header has {len(named)} names for {width} columns, expected one per column"
        raise InputError(message, file=path, place="header")
    names: list[str] = []
    for i, name in enumerate(named):
        name = name or f"column{i + 1}"
        names.append(name if name not in names else f"{name}#{i + 1}")
    return names, {name: unit for name, unit in zip(names, stated, strict=True) if unit}


def commas(content: bytes) -> bytes:
    """A text whose cells are separated by spaces, with commas instead."""
    lines = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", content.replace(b"\r\n", b"\n"))
    return re.sub(rb"[ \t]+", b",", lines)


DELIMITED = LogFormat("CSV", read_delimited, suffixes=(".csv", ".txt", ".tsv", ".dat", ".log"))
