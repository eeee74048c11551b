"""A report as Markdown; charts become their descriptions, values are escaped."""

from __future__ import annotations

import re

from flexviz.charts import Chart
from flexviz.report.blocks import (
    Block,
    Callout,
    Cell,
    Items,
    Listing,
    Paragraph,
    ReportDocument,
    ReportTable,
    Section,
    Tiles,
)
from flexviz.wording import as_markdown, markdown_table


def markdown(document: ReportDocument) -> str:
    """The whole text."""
    parts = [f"# {plain(document.title)}", plain(document.subtitle)]
    if document.tags:
        parts.append(" · ".join(f"*{plain(tag)}*" for tag in document.tags))
    parts += [_section(section, 2) for section in document.sections]
    return "\n\n".join([*parts, "---", plain(document.footer)]) + "\n"


def _section(section: Section, level: int) -> str:
    heading = [f"{'#' * level} {plain(section.title)}"] if section.title else []
    parts = [_section(part, level + 1) for part in section.parts]
    return "\n\n".join([*heading, *map(_block, section.blocks), *parts])


def _block(block: Block) -> str:
    match block:
        case Paragraph():
            return plain(block.text)
        case Callout():
            return f"> **{plain(block.text)}**"
        case Tiles():
            return "\n".join(
                f"- {plain(t.label)}: **{plain(t.value)}**" + (f" ({plain(t.note)})" if t.note else "")
                for t in block.tiles
            )
        case Chart():
            return f"*{plain(block.title)}.* {plain(block.description)}"
        case Items():
            return "\n".join(f"- {plain(item)}" for item in block.items)
        case Listing():
            fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", block.text)), default=0))
            return f"{fence}{block.language}\n{block.text}\n{fence}"
        case ReportTable():
            head = [plain(title) or " " for title in block.head]
            lines = markdown_table(head, [list(map(_cell, row)) for row in block.rows], block.numbers)
            return "\n".join([*([f"*{plain(block.caption)}*", ""] if block.caption else []), *lines])


def plain(text: str) -> str:
    """Text on one line with Markdown characters escaped."""
    return as_markdown(" ".join(text.split()))


def _cell(cell: Cell) -> str:
    words = plain(cell.text) or " "
    return f"**{words}**" if cell.strong and words.strip() else words
