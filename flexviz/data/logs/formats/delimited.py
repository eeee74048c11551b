"""Wide CSV files with any column names and separators, with or without a header and units."""

from __future__ import annotations

import codecs
import csv
import re
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from flexviz.base.errors import InputError
from flexviz.data.logs.column_names import known_unit
from flexviz.data.logs.formats.base import Log, LogFormat, LogTable, ReadOptions, check_rows
from flexviz.data.logs.formats.frames import read_frames
from flexviz.data.logs.formats.parquet import columns_of, is_number
from flexviz.data.logs.formats.twincat import scope_header, with_one_clock
from flexviz.data.measurements import readable

HEAD = 1 << 16  # [bytes] from which the layout is found
EMPTY = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "NULL", "None", "none", "-"]
ROW_END = ""  # name of the field after the separator with which rows end
ROWS_END = "each row ends with a separator: the empty field after it is left out"
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

    short: bool = False  # the header has one name less than there are fields


def read_delimited(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers of a CSV file."""
    with readable(path, "CSV table"):
        with path.open("rb") as stream:
            head = stream.read(HEAD)
        if b"<Rob" in head:
            return read_frames(path, options)
        layout = find_layout(head, path)
        end, cut = end_of_whole_rows(path, layout)

        def read(layout: CsvLayout) -> pa.Table:
            needed = {ROW_END, layout.names[0] if layout.short else ROW_END}
            kept = [n for n in layout.names if n in needed or layout.scope or options.wants(n)]
            return read_table(path, layout, kept, end)

        table, notes = read(layout), [cut] if cut else []
        if ROW_END in layout.names:
            if table[ROW_END].null_count == table.num_rows:
                notes.append(ROWS_END)
                unneeded = {ROW_END, *(n for n in layout.names[:1] if not options.wants(n))}
                table = table.drop_columns([n for n in table.column_names if n in unneeded])
            else:
                layout = with_last_column(table, layout, path)
                table = read(layout)
    check_rows(table.num_rows, path)
    kinds = {field.name: field.type for field in table.schema}
    usable = [name for name, kind in kinds.items() if is_number(kind) or pa.types.is_timestamp(kind)]
    columns, units, unusable = columns_of(table.select(usable), {})
    for name, kind in kinds.items():
        if pa.types.is_null(kind):
            unusable[name] = "it is empty"
        elif pa.types.is_string(kind) or pa.types.is_binary(kind):
            unusable[name] = first_text(table[name], layout)
    unread = tuple(n for n in layout.names if n != ROW_END and n not in table.column_names)
    columns = with_one_clock(columns) if layout.scope else columns
    columns_here = LogTable("", columns, None, layout.units | units)
    return Log(path, "CSV", (columns_here,), unusable, tuple(notes), unread)


def with_last_column(table: pa.Table, layout: CsvLayout, path: Path) -> CsvLayout:
    """The layout where the last field is a column; if the header is short, the first one has row names.

    InputError where the last field is filled in some rows only and the first one does not count the rows.
    """
    *names, _ = layout.names
    if not layout.short:
        return replace(layout, names=[*names, f"column{len(layout.names)}"])
    first, last = table.column(names[0]), table[ROW_END]
    if last.null_count:
        numbers = first.to_numpy() if pa.types.is_integer(first.type) else np.zeros(0)
        if not len(numbers) or np.any(np.diff(numbers) != 1):
            row = last.is_valid().index(True).as_py() + 1
            message = (
                f"the header has {len(names)} names for {len(names) + 1} columns, and the last field is "
                f"empty in {last.null_count} of {table.num_rows} rows but not in row {row} "
                f"(line {row + layout.skip}), expected one name per column"
            )
            raise InputError(message, file=path, place="header")
    return replace(layout, names=["row", *names], short=False)


def end_of_whole_rows(path: Path, layout: CsvLayout) -> tuple[int | None, str]:
    """Where what was cut off begins [bytes], and what it is; None and nothing where the file is complete.

    Cut off: zeros, as a file system leaves them after a power cut; or a last line with fewer cells than
    columns, or no number where the line before has one, and no end of line.
    """
    size = length = path.stat().st_size
    wide = layout.encoding.startswith("utf-16")
    with path.open("rb") as stream:
        tail = b""
        while not tail and length and not wide:  # zeros alone are no text
            at = max(0, length - HEAD)
            stream.seek(at)
            tail = stream.read(length - at).rstrip(b"\0")
            length = at + len(tail)
        begin = max(0, length - HEAD) // 2 * 2
        stream.seek(begin)
        tail = stream.read(length - begin)
    zeros = size - length
    told = f"the last {zeros} bytes are zeros, as after a power cut, and left out" if zeros else ""
    text = tail.decode(layout.encoding, "replace")
    if text.endswith(("\n", "\r")):
        return (length if zeros else None), told
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) < 2:
        return (length if zeros else None), told
    before, last = (split(line, layout.separator) for line in lines[-2:])
    if len(before) != len(layout.names):
        return (length if zeros else None), told
    pairs = zip(before, last, strict=False)
    broken = any(is_numeral(b, layout.decimal) and not is_numeral(c, layout.decimal) for b, c in pairs)
    if broken or len(last) < len(before):
        length -= len(lines[-1].encode(layout.encoding, "replace"))
        told = f"{told}; so is the line before them" if zeros else "the last line is cut off and left out"
    return (length if told else None), told


def read_table(path: Path, layout: CsvLayout, names: list[str], end: int | None) -> pa.Table:
    """The columns `names` of a file, up to its byte `end`."""
    spaces = layout.separator == " "
    content, encoding = path.read_bytes()[:end] if spaces or end is not None else None, layout.encoding
    if content is not None and encoding.startswith("utf-16"):
        content, encoding = content.decode(encoding).encode(), "utf8"
    return pacsv.read_csv(
        path if content is None else pa.BufferReader(commas(content) if spaces else content),
        pacsv.ReadOptions(
            use_threads=False, skip_rows=layout.skip, column_names=layout.names, encoding=encoding
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
    text, encoding = text_of(head, path)
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
                names, units, short = header([cells for k, cells in rows if k < i], len(row), path)
                return CsvLayout(separator, decimal, i, names, units, encoding, short=short)
    cells = [line.strip() for line in lines if line.strip()]
    if len(cells) > 1 and all(is_numeral(cell, ".") for cell in cells[1:]):
        message = (
            "each row holds one number, expected at least two columns; arrays in files of their own, also "
            "with the values of several joints in one column, can be read from one .npz"
        )
        raise InputError(message, file=path)
    expected = "expected a header and rows of numbers, separated by commas, semicolons, tabs or spaces"
    raise InputError(f"no rows of numbers were found, {expected}", file=path)


def text_of(head: bytes, path: Path) -> tuple[str, str]:
    """The text at the beginning of a file, and how it is encoded."""
    if encoding := wide_encoding(head):
        return head[: len(head) // 2 * 2].decode(encoding, "ignore").removeprefix("\ufeff"), encoding
    cut = len(head) == HEAD
    head = head.rstrip(b"\0")
    if (at := head.find(b"\0")) >= 0:
        line = head.count(b"\n", 0, at) + 1
        raise InputError(
            "not a text file, expected a CSV table: a byte is zero", file=path, place=f"line {line}"
        )
    try:
        return head.decode("utf-8-sig", "ignore" if cut else "strict"), "utf8"
    except UnicodeDecodeError:
        return head.decode("cp1252", "replace"), "cp1252"


def wide_encoding(head: bytes) -> str | None:
    """UTF-16, as "Unicode text" of spreadsheets, by its mark or by the zero in every second byte."""
    for encoding, mark, zero in (
        ("utf-16-le", codecs.BOM_UTF16_LE, 1),
        ("utf-16-be", codecs.BOM_UTF16_BE, 0),
    ):
        zeros, others = head[zero::2], head[1 - zero :: 2]
        if head.startswith(mark) or (len(head) > 1 and not any(zeros) and all(others)):
            return encoding
    return None


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


def header(before: list[list[str]], width: int, path: Path) -> tuple[list[str], dict[str, str], bool]:
    """Names of the columns, the units of a line of units below them, and whether a name is missing.

    Where it is, the first field has row names, or the rows end with a separator: the last field tells.
    """
    rows = []
    for cells in before:
        if cells and cells[0] in ("#", "%"):
            cells = cells[1:]
        elif cells:
            cells = [cells[0].lstrip("#% ") if cells[0][:1] in "#%" else cells[0], *cells[1:]]
        if any(cells):
            rows.append(cells)
    if not rows:
        return [f"column{i + 1}" for i in range(width)], {}, False
    named = rows[-1]
    stated: list[str | None] = [None] * width
    if len(rows) > 1 and len(rows[-1]) == width == len(rows[-2]):
        units = [known_unit(cell.strip("[]()")) for cell in rows[-1]]
        filled = sum(bool(cell.strip("[]()- ")) for cell in rows[-1])
        if filled and 2 * sum(unit is not None for unit in units) >= filled:  # a line of units
            named, stated = rows[-2], units
    if len(named) == width + 1 and not named[-1]:
        named = named[:-1]  # the header alone ends with a separator
    if short := len(named) == width - 1:
        named = [*named, ""]
    if len(named) != width:
        message = f"the header has {len(named)} names for {width} columns, expected one per column"
        raise InputError(message, file=path, place="header")
    names: list[str] = []
    for i, name in enumerate(named):
        name = name or (ROW_END if i == width - 1 else f"column{i + 1}")
        names.append(name if name not in names else f"{name}#{i + 1}")
    return names, {name: unit for name, unit in zip(names, stated, strict=True) if unit}, short


def commas(content: bytes) -> bytes:
    """A text whose cells are separated by spaces, with commas instead."""
    lines = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", content.replace(b"\r\n", b"\n"))
    return re.sub(rb"[ \t]+", b",", lines)


DELIMITED = LogFormat("CSV", read_delimited, suffixes=(".csv", ".txt", ".tsv", ".dat", ".log"))
