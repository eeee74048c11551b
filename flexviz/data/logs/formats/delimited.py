"""Wide CSV files with any column names and separators, with or without a header and units."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.data.logs.formats.base import Log, LogFormat, LogTable, ReadOptions, check_rows
from flexviz.data.logs.formats.csv_layouts import (
    EMPTY,
    HEAD,
    CsvLayout,
    encoding_of,
    find_layout,
    in_utf_8,
    is_numeral,
    split,
)
from flexviz.data.logs.formats.frames import read_frames
from flexviz.data.logs.formats.parquet import columns_of, is_number
from flexviz.data.logs.formats.twincat import with_one_clock
from flexviz.data.measurements import CELL, Damage, RecordError, cut_off, first_damage, has_zeros, readable

CUT_NUMBERS = ("", "-")  # that may have been the beginning of a number
RARE = 0.05  # probability of a number as short as a last one that is taken for cut off


def read_delimited(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers of a CSV file."""
    with readable(path, "CSV table"):
        with path.open("rb") as stream:
            head = stream.read(HEAD)
        if b"<Rob" in head:
            return read_frames(path, options)
        wide = encoding_of(head) != "utf-8"
        content = in_utf_8(path.read_bytes()) if wide else None
        layout = find_layout(head if content is None else content[:HEAD], path)
        text, notes = whole_rows(CsvText(path, layout, content))
        first = {layout.names[0]} if layout.missing == 1 else set()
        wanted = [n for n in layout.names if layout.scope or options.wants(n) or n in first or not n.strip()]
        text, table = text.table(wanted)
        if layout.ends:
            if all(table[name].null_count == table.num_rows for name in layout.ends):
                notes.append(Fact("row-ends", values={"empty": len(layout.ends)}).text)
                unneeded = {*layout.ends, *(n for n in first if not options.wants(n))}
                table = table.drop_columns([n for n in table.column_names if n in unneeded])
            else:
                layout = with_last_columns(table, layout, path)
                named = replace(text, layout=layout)
                text, table = named.table([n for n in layout.names if options.wants(n)])
    check_rows(table.num_rows, path)
    kinds = {field.name: field.type for field in table.schema}
    usable = [name for name, kind in kinds.items() if is_number(kind) or pa.types.is_timestamp(kind)]
    columns, units, unusable = columns_of(table.select(usable), {})
    for name, kind in kinds.items():
        if pa.types.is_null(kind):
            unusable[name] = "it is empty"
        elif pa.types.is_string(kind) or pa.types.is_binary(kind):
            unusable[name] = text.first_text(name)
    unread = tuple(n for n in layout.names if n.strip() and n not in table.column_names)
    columns = with_one_clock(columns) if layout.scope else columns
    columns_here = LogTable("", columns, None, layout.units | units)
    return Log(path, "CSV", (columns_here,), unusable, tuple(notes), unread)


@dataclass(frozen=True, eq=False)
class CsvText:
    """The text of a table.

    Attributes:
        path: of its file.
        layout: how it is written.
        content: in the layout's encoding; None: that of the file.
    """

    path: Path
    layout: CsvLayout
    content: bytes | None

    def open(self) -> BinaryIO:
        """The text as a stream."""
        return self.path.open("rb") if self.content is None else BytesIO(self.content)

    def damage(self, numbers: tuple[str, ...] = ()) -> Damage | None:
        """The first damaged row, where the columns `numbers` are to hold numbers."""
        layout = self.layout
        with self.open() as stream:
            check = RowCheck(layout, numbers)
            return first_damage(stream, check, skip=layout.skip, end=layout.end, encoding=layout.encoding)

    def first_text(self, name: str) -> str:
        """Why a column is taken for text: its first cell that is not a number."""
        if (damage := self.damage((name,))) is None:
            return "its numbers are written in more than one way"
        if damage.wrong.column != name:
            raise damage.error(self.path)
        where = f"row {damage.row} (line {damage.line})"
        return f"{where} holds {damage.wrong.found}, expected {damage.wrong.expected}"

    def table(self, names: list[str]) -> tuple[CsvText, pa.Table]:
        """The columns `names`; with the text, whose rows may have been made even.

        Raises:
            InputError: a row is damaged.
        """
        try:
            return self, self.read(names)
        except pa.ArrowInvalid:
            if damage := self.damage():
                raise damage.error(self.path) from None
        even = self.even()
        return even, even.read(names)

    def read(self, names: list[str]) -> pa.Table:
        """The columns `names`, where each row has a field for each name."""
        layout, content = self.layout, self.content
        spaces = layout.separator == " "
        if spaces:
            content = commas(self.path.read_bytes() if content is None else content)
        return pacsv.read_csv(
            self.path if content is None else pa.BufferReader(content),
            pacsv.ReadOptions(
                use_threads=False, skip_rows=layout.skip, column_names=layout.names, encoding=layout.encoding
            ),
            pacsv.ParseOptions(delimiter="," if spaces else layout.separator),
            pacsv.ConvertOptions(
                null_values=EMPTY,
                strings_can_be_null=True,
                decimal_point=layout.decimal,
                include_columns=names,
            ),
        )

    def even(self) -> CsvText:
        """The text with as many fields in each row as there are names: some rows end with separators."""
        layout = self.layout
        with self.open() as stream:
            lines = stream.read().decode(layout.encoding, "replace").splitlines()
        width, separator = len(layout.names), layout.separator
        for k, line in enumerate(lines[layout.skip :], start=layout.skip):
            if not line.strip():
                continue
            more = width - len(split(line, separator))
            lines[k] = line + more * separator if more > 0 else line[: len(line.rstrip()) + more]
        return replace(self, content="\n".join([*lines, ""]).encode(layout.encoding, "replace"))


@dataclass(eq=False)
class RowCheck:
    """Raises for a row with too few or many fields, with text for a number, or with a number that is cut off.

    Attributes:
        layout: of the table.
        numbers: columns that hold numbers; None: those that do in the row before.
        before: the row before.
        lengths: of the last numbers of the rows before.
    """

    layout: CsvLayout
    numbers: tuple[str, ...] | None = None
    before: list[str] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)

    def __call__(self, text: str, ended: bool) -> None:
        names, decimal = self.layout.names, self.layout.decimal
        cells = split(text.removeprefix("\ufeff"), self.layout.separator)
        fewest = len(names) - len(self.layout.ends)
        if cells[:fewest] == names[:fewest]:
            raise RecordError(
                "the header again", "one run per file", remedy="begin another file with this line"
            )
        if len(cells) < fewest or any(cells[len(names) :]):
            raise RecordError(f"{len(cells)} values for {fewest} columns", "one per column")
        for k, (name, cell) in enumerate(zip(names, cells, strict=False)):
            is_one = self.before and is_numeral(self.before[k], decimal)
            if self.numbers is not None:
                is_one = name in self.numbers
            if is_one and cell not in EMPTY and not is_numeral(cell, decimal):
                raise RecordError(f'"{cell[:40]}"', "a number", name, CELL)
        last = cells[fewest - 1]
        if not ended and len(cells) == fewest and self._is_cut(last):
            raise RecordError(f'"{last}" at the end of the file', "a whole number")
        self.before = cells + [""] * (len(names) - len(cells))
        self.lengths += [len(last)] if is_numeral(last, decimal) else []

    def _is_cut(self, cell: str) -> bool:
        """Whether a number without an end of line is cut off: those before it are rarely as short."""
        if not self.lengths or cell in EMPTY:
            return bool(self.lengths) and cell in CUT_NUMBERS
        return sum(one <= len(cell) for one in self.lengths) < RARE * len(self.lengths)


def whole_rows(text: CsvText) -> tuple[CsvText, list[str]]:
    """The text without what a power cut has left at its end, and a note on it.

    Raises:
        InputError: there are zeros between the rows.
    """
    layout, notes = text.layout, []
    with text.open() as stream:
        cut = cut_off(stream, RowCheck(layout), skip=layout.skip, end=layout.end, encoding=layout.encoding)
        if cut is not None:
            stream.seek(0)
            text = replace(text, content=stream.read(cut.end))
            notes = [Fact("cut-off", values={"zeros": cut.zeros, "record": cut.found}).text]
    with text.open() as stream:
        zeros = has_zeros(stream)
    if zeros and (damage := text.damage()):
        raise damage.error(text.path)
    return text, notes


def with_last_columns(table: pa.Table, layout: CsvLayout, path: Path) -> CsvLayout:
    """The layout where the last fields are columns; if the header is short, the first one has row names.

    InputError where the last field is filled in some rows only and the first one does not count the rows.
    """
    names = layout.names[: len(layout.names) - len(layout.ends)]
    if not layout.missing:
        return replace(
            layout, names=[n if n.strip() else f"column{k + 1}" for k, n in enumerate(layout.names)]
        )
    first, (end, *others) = table.column(names[0]), layout.ends
    last = table[end]
    if last.null_count or others:
        numbers = first.to_numpy() if pa.types.is_integer(first.type) else np.zeros(0)
        if others or not len(numbers) or np.any(np.diff(numbers) != 1):
            filled = next(table[name] for name in layout.ends if table[name].null_count < table.num_rows)
            row = filled.is_valid().index(True).as_py() + 1
            message = (
                f"the header has {len(names)} names for {len(layout.names)} columns, and the last field is "
                f"empty in {filled.null_count} of {table.num_rows} rows but not in row {row} "
                f"(line {row + layout.skip}), expected one name per column"
            )
            raise InputError(message, file=path, place="header")
    return replace(layout, names=["row", *names], missing=0)


def commas(content: bytes) -> bytes:
    """A text whose cells are separated by spaces, with commas instead."""
    lines = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", content.replace(b"\r\n", b"\n"))
    return re.sub(rb"[ \t]+", b",", lines)


DELIMITED = LogFormat("CSV", read_delimited, suffixes=(".csv", ".txt", ".tsv", ".dat", ".log"))
