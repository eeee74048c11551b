"""Format-independent report: sections of paragraphs, tables and charts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from flexviz.content.charts import Chart

FIGURE_HEIGHT = 230  # [px] of a chart without its legend
SMALL_HEIGHT = 190  # [px] of one of three side by side
Tone = Literal["", "good", "missing", "unknown", "warn"]


@dataclass(frozen=True)
class Paragraph:
    """A few sentences; `quiet` marks an explanation."""

    text: str
    quiet: bool = False


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
    """A table cell; `shade` 0 … 1 sets its background, None leaves it white."""

    text: str
    shade: float | None = None
    strong: bool = False


@dataclass(frozen=True)
class ReportTable:
    """A table; `numbers` are indices of numeric columns, `dense` is small print for many columns."""

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    numbers: Sequence[int] = ()
    caption: str = ""
    dense: bool = False


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
class Items:
    """A bulleted list."""

    items: Sequence[str]


@dataclass(frozen=True)
class Listing:
    """Code to copy; `language` is "sh" or "python"."""

    text: str
    language: str


Block = Paragraph | Callout | Tiles | ReportTable | Chart | Figures | Items | Listing


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


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str | Cell]],
    numbers: Sequence[int] = (),
    caption: str = "",
    dense: bool = False,
) -> ReportTable:
    """A table of texts and cells."""
    cells = [[c if isinstance(c, Cell) else Cell(c) for c in row] for row in rows]
    return ReportTable(head, cells, numbers, caption, dense)
