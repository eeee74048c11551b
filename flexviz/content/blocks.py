"""What every medium draws: paragraphs, tables, tiles, callouts, charts, lists, details, in sections."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from flexviz.content.charts import Chart

FIGURE_HEIGHT = 230  # [px] of a chart without its legend
SMALL_HEIGHT = 190  # [px] of one of three side by side
LISTED = 4  # entries named of what may be long
Tone = Literal["", "good", "missing", "unknown", "warn", "old"]


@dataclass(frozen=True)
class Paragraph:
    """A few sentences; `quiet` marks an explanation, `strong` what must be seen first."""

    text: str
    quiet: bool = False
    strong: bool = False


@dataclass(frozen=True)
class Callout:
    """A sentence in a box: verdict or warning."""

    text: str
    tone: Tone


@dataclass(frozen=True)
class Tile:
    """A key figure."""

    label: str
    value: str
    note: str = ""


@dataclass(frozen=True)
class Tiles:
    """A row of tiles."""

    tiles: Sequence[Tile]


@dataclass(frozen=True)
class Cell:
    """A table cell.

    Attributes:
        text: what stands in it.
        shade: 0 … 1 sets its background, None leaves it white.
        strong: whether it is to be seen first.
        tip: what a page tells of it under the pointer.
        short: stands in its place on narrow terminals; empty: the text.
        tone: of a mark: a grade, "warn" or "truth".
    """

    text: str
    shade: float | None = None
    strong: bool = False
    tip: str = ""
    short: str = ""
    tone: str = ""


@dataclass(frozen=True)
class TableBlock:
    """A table.

    Attributes:
        head: titles of the columns.
        rows: their cells.
        numbers: indices of numeric columns, which are never broken.
        caption: above it.
        dense: small print, for many columns.
        fold: text columns that a narrow terminal may break.
        below: columns that narrow pages write below the row, after these words.
        group: a column that narrow pages write once above the rows that share it.
        faint: rows of what is not known.
        shorts: explains what stands for texts on a narrow terminal.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    numbers: Sequence[int] = ()
    caption: str = ""
    dense: bool = False
    fold: Collection[int] = (0,)
    below: Mapping[int, str] = field(default_factory=dict)
    group: int | None = None
    faint: Collection[int] = ()
    shorts: str = ""


@dataclass(frozen=True)
class Picture:
    """A drawing with its caption: elements of SVG in a frame of `size` (width, height) [px]."""

    title: str
    description: str
    size: tuple[int, int]
    elements: Sequence[str]


@dataclass(frozen=True)
class Figures:
    """Charts and pictures side by side, in rows of `columns`; of a chart's texts only title and note show."""

    figures: Sequence[Chart | Picture]
    columns: int = 3


@dataclass(frozen=True)
class Item:
    """An entry of a list, and what is told below it."""

    text: str
    parts: Sequence[str] = ()


@dataclass(frozen=True)
class Items:
    """A list, `ranked` with numbers."""

    items: Sequence[str | Item]
    ranked: bool = False


@dataclass(frozen=True)
class Details:
    """Blocks that are folded where a page can; with their title elsewhere."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Meter:
    """A share, 0 … 1, in words, and as a bar where a page can draw; `strong` from where it convinces."""

    text: str
    share: float
    strong: bool = False


@dataclass(frozen=True)
class Listing:
    """Code to copy; `language` is "sh" or "python"."""

    text: str
    language: str


Block = Paragraph | Callout | Tiles | TableBlock | Chart | Figures | Items | Details | Meter | Listing


@dataclass(frozen=True)
class Section:
    """A titled section; its subsections follow its blocks."""

    title: str
    blocks: Sequence[Block]
    parts: Sequence[Section] = ()


@dataclass(frozen=True)
class ReportDocument:
    """A whole report; tags are short remarks such as "simulated data"."""

    title: str
    subtitle: str
    tags: Sequence[str]
    sections: Sequence[Section]
    footer: str


def section(title: str, *blocks: Block | None, parts: Sequence[Section] = ()) -> Section:
    """A section of the blocks that are not None."""
    return Section(title, [block for block in blocks if block is not None], parts)


def explanation(text: str) -> Paragraph:
    """A quiet paragraph."""
    return Paragraph(text, quiet=True)


def warning(text: str) -> Callout:
    """What needs attention."""
    return Callout(text, "warn")


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str | Cell]],
    numbers: Sequence[int] = (),
    caption: str = "",
    dense: bool = False,
    **roles: Any,
) -> TableBlock:
    """A table of texts and cells; `roles` of rows and columns as `TableBlock` has them."""
    cells = [[c if isinstance(c, Cell) else Cell(c) for c in row] for row in rows]
    return TableBlock(head, cells, numbers, caption, dense, **roles)
