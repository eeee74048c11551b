"""Format-independent report: sections of paragraphs, tables and charts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from flexviz.charts import Chart

FIGURE_HEIGHT = 260  # [px] of a chart without its legend
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

    tiles: tuple[Tile, ...]


@dataclass(frozen=True)
class Cell:
    """A table cell; `shade` 0 … 1 sets its background, None leaves it white."""

    text: str
    shade: float | None = None
    strong: bool = False


@dataclass(frozen=True)
class ReportTable:
    """A table.

    Attributes:
        head: column titles.
        numbers: indices of the numeric columns.
        dense: small print, for many columns.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    numbers: tuple[int, ...] = ()
    caption: str = ""
    dense: bool = False


@dataclass(frozen=True)
class Items:
    """A bulleted list."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Listing:
    """Code to copy; `language` is "sh" or "python"."""

    text: str
    language: str


Block = Paragraph | Callout | Tiles | ReportTable | Chart | Items | Listing


@dataclass(frozen=True)
class Section:
    """A titled section; its subsections follow its blocks."""

    title: str
    blocks: tuple[Block, ...]
    parts: tuple[Section, ...] = ()


@dataclass(frozen=True)
class ReportDocument:
    """A whole report; tags are short remarks such as "simulated data"."""

    title: str
    subtitle: str
    tags: tuple[str, ...]
    sections: tuple[Section, ...]
    footer: str


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str | Cell]],
    numbers: Sequence[int] = (),
    caption: str = "",
    dense: bool = False,
) -> ReportTable:
    """A table of texts and cells."""
    cells = tuple(tuple(c if isinstance(c, Cell) else Cell(c) for c in row) for row in rows)
    return ReportTable(tuple(head), cells, tuple(numbers), caption, dense)


class ReportWriter(ABC):
    """Base of the output formats: one method per kind of block."""

    @abstractmethod
    def document(self, document: ReportDocument) -> str:
        """The whole text."""

    @abstractmethod
    def section(self, title: str, level: int, contents: Sequence[str]) -> str:
        """A section with its written blocks and parts."""

    @abstractmethod
    def paragraph(self, block: Paragraph) -> str: ...
    @abstractmethod
    def callout(self, block: Callout) -> str: ...
    @abstractmethod
    def tiles(self, block: Tiles) -> str: ...
    @abstractmethod
    def table(self, block: ReportTable) -> str: ...
    @abstractmethod
    def chart(self, block: Chart) -> str: ...
    @abstractmethod
    def items(self, block: Items) -> str: ...
    @abstractmethod
    def listing(self, block: Listing) -> str: ...

    def walk(self, section: Section, level: int = 2) -> str:
        """A section with its blocks and subsections as text."""
        blocks = [self._block(block) for block in section.blocks]
        parts = [self.walk(part, min(level + 1, 6)) for part in section.parts]
        return self.section(section.title, level, [*blocks, *parts])

    def _block(self, block: Block) -> str:
        match block:
            case Paragraph():
                return self.paragraph(block)
            case Callout():
                return self.callout(block)
            case Tiles():
                return self.tiles(block)
            case ReportTable():
                return self.table(block)
            case Chart():
                return self.chart(block)
            case Items():
                return self.items(block)
            case Listing():
                return self.listing(block)
