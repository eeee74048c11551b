"""The first damaged record of a text file: a row of a table, a line of JSON, an XML frame.

A power cut leaves part of one record at the end of a file, and zeros; the records before it are whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from flexviz.base.errors import InputError

ZERO = b"\0"  # with which a file system fills what it had not yet written
NO_TEXT = "\N{REPLACEMENT CHARACTER}"  # in place of bytes that are no text
TAIL = 1 << 16  # [bytes] in which the last record is looked for
LINE = "complete or delete it"  # the remedy of a wrong line
CELL = "correct or delete it"  # the remedy of a wrong cell
BLOCK = 1 << 20  # [bytes] that are looked at together


class RecordError(Exception):
    """What is wrong with a record.

    Args:
        found: in it.
        expected: instead.
        column: of its table.
        remedy: what mends it.
    """

    def __init__(self, found: str, expected: str, column: str = "", remedy: str = LINE) -> None:
        self.found, self.expected, self.column, self.remedy = found, expected, column, remedy
        super().__init__(f"found {found}, expected {expected}")


Check = Callable[[str, bool], None]
"""Raises a RecordError for a record's text; whether it has an end."""


@dataclass(frozen=True)
class Damage:
    """A damaged record.

    Attributes:
        wrong: what is wrong with it.
        row: its number, from 1.
        line: of the file, from 1.
        begin: where it begins [bytes].
        more: damaged records after it.
        final: whether it is what a power cut leaves: part of one record, and zeros.
    """

    wrong: RecordError
    row: int
    line: int
    begin: int
    more: int
    final: bool

    def error(self, file: Path, record: str = "") -> InputError:
        """The error that names it, as a row of a table or another `record`."""
        wrong = self.wrong
        also = f" (and {self.more} more like it)" if self.more else ""
        column = f", column {wrong.column}" if wrong.column else ""
        where = f"{record} {self.row}" if record else f"row {self.row} (line {self.line}){column}"
        message = f"found {wrong.found}, expected {wrong.expected}: {wrong.remedy}{also}"
        return InputError(message, file=file, place=where)


def first_damage(
    stream: BinaryIO, check: Check, *, skip: int = 0, end: bytes = b"\n", encoding: str = "utf-8"
) -> Damage | None:
    """The first record of `stream` that is no text or that `check` finds wrong; blank ones do not count.

    Args:
        stream: the file, from the beginning of a record.
        check: of a record.
        skip: records to leave out at the beginning: a header.
        end: of each record.
        encoding: of its text.
    """
    first: Damage | None = None
    row = line = begin = longest = 0
    final = True
    for raw in records(stream, end):
        line += 1
        here, begin = begin, begin + len(raw)
        content = raw.strip()
        if line <= skip or not content:
            continue
        row += 1
        wrong = _wrong(content, raw.endswith(end), check, encoding)
        if wrong is None:
            final = final and first is None
            longest = max(longest, len(raw))
        elif first is None:
            first = Damage(wrong, row, line, here, 0, False)
            final = len(raw.replace(ZERO, b"")) <= longest
        else:
            first = Damage(first.wrong, first.row, first.line, first.begin, first.more + 1, False)
            final = final and not content.strip(ZERO)
    if first is None or not final:
        return first
    return Damage(first.wrong, first.row, first.line, first.begin, first.more, True)


def records(stream: BinaryIO, end: bytes) -> Iterator[bytes]:
    """The records of a stream, with their ends."""
    if end == b"\n":
        yield from stream
        return
    pieces = stream.read().split(end)
    yield from (piece + end for piece in pieces[:-1])
    if pieces[-1]:
        yield pieces[-1]


def _wrong(raw: bytes, ended: bool, check: Check, encoding: str) -> RecordError | None:
    """What is wrong with a record: zeros, bytes that are no text, or what `check` finds."""
    text = raw.decode(encoding, "replace")
    try:
        if zeros := raw.count(ZERO):
            raise RecordError(f"{zeros} zeros, as after a power cut", "text", remedy="delete it")
        if NO_TEXT in text:
            at = text.index(NO_TEXT)
            raise RecordError(f'bytes that are no text after "{text[max(0, at - 20) : at]}"', "text")
        check(text, ended)
    except RecordError as error:
        return error
    return None


@dataclass(frozen=True)
class CutOff:
    """What a power cut has left at the end of a file.

    Attributes:
        end: of the whole records [bytes].
        zeros: behind the text.
        found: in the record that is cut off; "" where there is none.
    """

    end: int
    zeros: int
    found: str = ""


def cut_off(
    stream: BinaryIO, check: Check, *, skip: int = 0, end: bytes = b"\n", encoding: str = "utf-8"
) -> CutOff | None:
    """What a power cut has left at the end of `stream`; None: nothing. Arguments as of `first_damage`."""
    size = length = stream.seek(0, 2)
    tail = b""
    while not tail and length:  # zeros alone are no text
        at = max(0, length - TAIL)
        stream.seek(at)
        tail = stream.read(length - at).rstrip(ZERO)
        length = at + len(tail)
    zeros, begin = size - length, max(0, length - TAIL)
    stream.seek(begin)
    part = BytesIO(stream.read(length - begin))
    damage = first_damage(part, check, skip=1 if begin else skip, end=end, encoding=encoding)
    if damage is not None and damage.final:
        return CutOff(begin + damage.begin, zeros, damage.wrong.found)
    return CutOff(length, zeros) if zeros else None


def has_zeros(stream: BinaryIO) -> bool:
    """Whether there is a byte that is zero."""
    return any(ZERO in block for block in iter(lambda: stream.read(BLOCK), b""))
