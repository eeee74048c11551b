"""How a text table is written, from its beginning: encoding, separator, decimal point, header, units."""

from __future__ import annotations

import codecs
import csv
import string
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.data.logs.column_names import known_unit
from flexviz.data.logs.formats.twincat import scope_header

HEAD = 1 << 16  # [bytes] from which the layout is found
EMPTY = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "NULL", "None", "none", "-"]
# separator, decimal point
LAYOUTS = ((";", ","), (";", "."), (",", "."), ("\t", ","), ("\t", "."), (" ", "."))
MARKS = {  # the longer ones first
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
PLAIN = frozenset(string.printable)


@dataclass(frozen=True)
class CsvLayout:
    """How a file is written.

    Attributes:
        separator, decimal: between cells, and the decimal point.
        skip: lines before the numbers.
        names: of the columns; of fields after the separators with which rows end, spaces.
        units: that are stated, by name.
        encoding: "utf-8" or "cp1252".
        end: of each line.
        scope: whether it is an export of TwinCAT Scope, whose channels have times of their own.
        missing: names that the header has less than there are fields.
    """

    separator: str
    decimal: str
    skip: int
    names: list[str]
    units: dict[str, str]
    encoding: str
    end: bytes
    scope: bool = False
    missing: int = 0

    @property
    def ends(self) -> list[str]:
        """The names of what follows the separators with which rows end."""
        return [name for name in self.names if not name.strip()]


def in_utf_8(content: bytes) -> bytes:
    """A text in UTF-16 or UTF-32, as "Unicode text" of spreadsheets, in UTF-8; other ones as they are."""
    encoding = encoding_of(content[:HEAD])
    if encoding == "utf-8":
        return content
    return content.decode(encoding, "replace").removeprefix("\ufeff").encode()


def encoding_of(head: bytes) -> str:
    """UTF-8, 16 or 32 by the mark at the beginning of a text; without one, that which has most plain text."""
    for mark, encoding in MARKS.items():
        if head.startswith(mark):
            return encoding

    def plain(encoding: str) -> int:
        """Bytes that are printable ASCII."""
        text = head.decode(encoding, "replace")
        return sum(map(text.count, PLAIN)) * (1 if encoding == "utf-8" else 2)

    return max(("utf-8", "utf-16-le", "utf-16-be"), key=plain)


def find_layout(head: bytes, path: Path) -> CsvLayout:
    """The layout of a file, from its beginning in UTF-8 or Windows-1252."""
    if head.startswith(b"PAR1"):
        raise InputError("this is a Parquet table, expected *.parquet as its name", file=path)
    text, encoding = text_of(head, path)
    lines, end = text.splitlines(), b"\r" if b"\r" in head and b"\n" not in head else b"\n"
    lines = lines[:-1] if len(head) == HEAD else lines
    if (scope := scope_header(lines, split)) is not None:
        separator, skip, names, units = scope
        decimal = "," if separator != "," and any("," in line for line in lines[skip:]) else "."
        return CsvLayout(separator, decimal, skip, names, units, encoding, end, scope=True)
    for separator, decimal in LAYOUTS:
        rows = [(i, split(line, separator)) for i, line in enumerate(lines) if line.strip()]
        # the numbers begin at the first two successive rows of equally many of them
        for (i, row), (_, after) in pairwise(rows):
            alike = len(row) == len(after) or len(row) - ending(row) == len(after) - ending(after)
            if alike and is_data(row, decimal) and is_data(after, decimal):
                width = max(len(row), len(after))
                empty = min(width - len(x) + ending(x) for x in (row, after))
                before = [cells for k, cells in rows if k < i]
                names, units, missing = header(before, width, empty, path)
                return CsvLayout(separator, decimal, i, names, units, encoding, end, missing=missing)
    cells = [line.strip() for line in lines if line.strip()]
    if len(cells) > 1 and all(is_numeral(cell, ".") for cell in cells[1:]):
        message = (
            "each row holds one number, expected at least two columns; arrays in files of their own, also "
            "with the values of several joints in one column, can be read from one .npz"
        )
        raise InputError(message, file=path)
    expected = "expected a header and rows of numbers, separated by commas, semicolons, tabs or spaces"
    found = "not a text file, " * any(char < " " and not char.isspace() for char in text)
    raise InputError(f"{found}no rows of numbers were found, {expected}", file=path)


def text_of(head: bytes, path: Path) -> tuple[str, str]:
    """The text at the beginning of a file, and how it is encoded."""
    cut = len(head) == HEAD
    try:
        text = codecs.getincrementaldecoder("utf-8-sig")().decode(head, not cut)
    except UnicodeDecodeError:
        return head.decode("cp1252", "replace"), "cp1252"
    return text, "utf-8"


def split(line: str, separator: str) -> list[str]:
    """The cells of a line."""
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]


def ending(cells: list[str]) -> int:
    """The number of empty cells at the end of a row."""
    return next((k for k, cell in enumerate(reversed(cells)) if cell), len(cells))


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


def header(
    before: list[list[str]], width: int, empty: int, path: Path
) -> tuple[list[str], dict[str, str], int]:
    """Names of the columns, the units of a line of units below them, and how many names are missing.

    Where one is, the first field has row names, or the rows end with a separator: the last field tells.
    Several are of `empty` fields at the ends of the rows.
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
        named = [f"column{i + 1}" for i in range(width - empty)]
        return [*named, *(" " * k for k in range(empty))], {}, 0
    named = rows[-1]
    stated: list[str | None] = [None] * width
    if len(rows) > 1 and len(rows[-1]) == width == len(rows[-2]):
        units = [known_unit(cell.strip("[]()")) for cell in rows[-1]]
        filled = sum(bool(cell.strip("[]()- ")) for cell in rows[-1])
        if filled and 2 * sum(unit is not None for unit in units) >= filled:  # a line of units
            named, stated = rows[-2], units
    if len(named) > width:  # the header alone ends with separators
        named = named[: max(width, len(named) - ending(named))]
    missing = width - len(named)
    if missing < 0 or missing > max(1, empty):
        message = f"the header has {len(named)} names for {width} columns, expected one per column"
        raise InputError(message, file=path, place="header")
    named = [*named, *[""] * missing]
    last = width - ending(named)
    names: list[str] = []
    for i, name in enumerate(named):
        name = name or (f"column{i + 1}" if i < last else " " * (i - last))
        names.append(name if name not in names else f"{name}#{i + 1}")
    return names, {name: unit for name, unit in zip(names, stated, strict=True) if unit}, missing
