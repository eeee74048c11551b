"""Excel workbooks (.xlsx): the widest sheet as a table, read like a CSV file."""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO
from xml.etree import ElementTree

from flexviz.base.errors import InputError
from flexviz.base.files import temporary_folder
from flexviz.base.limits import LARGEST_UNPACKED
from flexviz.data.logs.formats.base import Log, LogFormat, ReadOptions
from flexviz.data.logs.formats.delimited import read_delimited
from flexviz.data.measurements import readable

SPACE = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
MOST_COLUMNS = 16384  # of a sheet


def read_workbook(path: Path, options: ReadOptions) -> Log:
    """The columns of the sheet with most numbers."""
    with readable(path, "Excel workbook"), zipfile.ZipFile(path) as book, temporary_folder("sheet") as folder:
        if sum(info.file_size for info in book.infolist()) > LARGEST_UNPACKED:
            raise InputError(f"over {LARGEST_UNPACKED:,} bytes unpacked, expected less", file=path)
        texts = _shared_texts(book)
        sheets = sorted(
            name for name in book.namelist() if re.fullmatch(r"xl/worksheets/sheet\d+\.xml", name)
        )
        if not sheets:
            raise InputError("the workbook has no sheet, expected a table", file=path)
        largest = max(sheets, key=lambda name: book.getinfo(name).file_size)
        table = folder / "sheet.csv"
        with table.open("w", encoding="utf-8", newline="") as sink, book.open(largest) as stream:
            csv.writer(sink).writerows(_rows(stream, texts))
        try:
            log = read_delimited(table, options)
        except InputError as error:
            raise InputError(error.message, file=path, place=error.place) from None
    notes = (f"of {len(sheets)} sheets the largest is read",) if len(sheets) > 1 else ()
    return replace(log, file=path, kind="Excel", notes=(*log.notes, *notes))


def _shared_texts(book: zipfile.ZipFile) -> list[str]:
    if "xl/sharedStrings.xml" not in book.namelist():
        return []
    root = ElementTree.fromstring(book.read("xl/sharedStrings.xml"))
    return ["".join(part.text or "" for part in item.iter(f"{SPACE}t")) for item in root]


def _rows(stream: IO[bytes], texts: list[str]) -> Iterator[list[str]]:
    """The cells of each row, empty ones included."""
    for _, element in ElementTree.iterparse(stream):
        if element.tag != f"{SPACE}row":
            continue
        cells: list[str] = []
        for cell in element.iter(f"{SPACE}c"):
            letters = re.match(r"[A-Z]+", cell.get("r", ""))
            column = _index(letters[0]) if letters else len(cells)
            cells += [""] * (min(column, MOST_COLUMNS) - len(cells))
            value, kind = cell.findtext(f"{SPACE}v", ""), cell.get("t")
            if kind == "inlineStr":
                value = "".join(part.text or "" for part in cell.iter(f"{SPACE}t"))
            cells.append(texts[int(value)] if kind == "s" else value)
        element.clear()
        yield cells


def _index(letters: str) -> int:
    """The number of a column called A … XFD, from 0."""
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1


EXCEL = LogFormat("Excel (.xlsx)", read_workbook, suffixes=(".xlsx",))
