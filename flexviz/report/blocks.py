"""What a report consists of, however it is written: sections of paragraphs, tables and charts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from flexviz.charts import Chart

FIGURE_HEIGHT = 260  # [pixels] of a chart, legend not counted
Tone = Literal["", "good", "missing", "unknown", "warn"]


@dataclass(frozen=True)
class Strong:
    """Words that stand out."""

    text: str


@dataclass(frozen=True)
class Code:
    """What is typed: a command, a name of a file."""

    text: str


Inline = str | Strong | Code


@dataclass(frozen=True)
class Paragraph:
    """A few sentences; `quiet` ones explain."""

    parts: tuple[Inline, ...]
    quiet: bool = False


@dataclass(frozen=True)
class Callout:
    """A sentence in a box: the verdict, a warning."""

    text: str
    tone: Tone


@dataclass(frozen=True)
class Tile:
    """One number that a reader looks for first."""

    label: str
    value: str
    note: str = ""


@dataclass(frozen=True)
class Tiles:
    """A row of them."""

    tiles: tuple[Tile, ...]


@dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Attributes
    ----------
    text: what stands in it.
    shade: 0 … 1, how dark it is on the map of colours; None for none.
    strong: it stands out.
    """

    text: str
    shade: float | None = None
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    head: titles of the columns.
    rows: cells; as many in each row as there are columns.
    numbers: columns that hold numbers.
    caption: what it says.
    dense: small print, for many columns.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    numbers: tuple[int, ...] = ()
    caption: str = ""
    dense: bool = False


@dataclass(frozen=True)
class Figure:
    """A chart; where it cannot be drawn its description stands for it."""

    chart: Chart


@dataclass(frozen=True)
class Items:
    """A list."""

    items: tuple[tuple[Inline, ...], ...]


@dataclass(frozen=True)
class Listing:
    """Lines to be copied: a command, a program; `language` is "sh" or "python"."""

    text: str
    language: str


Block = Paragraph | Callout | Tiles | Table | Figure | Items | Listing


@dataclass(frozen=True)
class Section:
    """A part with a title; the parts within it follow its blocks."""

    title: str
    blocks: tuple[Block, ...]
    parts: tuple[Section, ...] = ()


@dataclass(frozen=True)
class Document:
    """A whole report.

    Attributes
    ----------
    title, subtitle: at its top.
    tags: a word or two each ("simulated data").
    sections: in reading order; the first needs no title.
    """

    title: str
    subtitle: str
    tags: tuple[str, ...]
    sections: tuple[Section, ...]


def text(*parts: Inline, quiet: bool = False) -> Paragraph:
    """A paragraph of these parts."""
    return Paragraph(parts, quiet)


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str | Cell]],
    numbers: Sequence[int] = (),
    caption: str = "",
    dense: bool = False,
) -> Table:
    """A table of texts and cells."""
    cells = tuple(tuple(c if isinstance(c, Cell) else Cell(c) for c in row) for row in rows)
    return Table(tuple(head), cells, tuple(numbers), caption, dense)
