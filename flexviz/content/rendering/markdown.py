"""Blocks as Markdown, for reports and Rerun's texts; charts become their descriptions, values are escaped."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from flexviz.content import blocks
from flexviz.content.charts import Chart
from flexviz.content.wording import as_markdown, markdown_table


def markdown(document: blocks.ReportDocument) -> str:
    """The whole text."""
    parts = [f"# {plain(document.title)}", plain(document.subtitle)]
    if document.tags:
        parts.append(" · ".join(f"*{plain(tag)}*" for tag in document.tags))
    parts += [_section(section, 2) for section in document.sections]
    return "\n\n".join([*parts, "---", plain(document.footer)]) + "\n"


def markdown_fragment(content: Iterable[blocks.Block]) -> str:
    """Blocks without a page's title and footer."""
    return "\n\n".join(map(_block, content))


def _section(section: blocks.Section, level: int) -> str:
    heading = [f"{'#' * level} {plain(section.title)}"] if section.title else []
    parts = [_section(part, level + 1) for part in section.parts]
    return "\n\n".join([*heading, *map(_block, section.blocks), *parts])


def _block(block: blocks.Block | blocks.Picture) -> str:
    match block:
        case blocks.Paragraph() | blocks.Meter():
            return plain(block.text)
        case blocks.Callout():
            return f"> **{plain(block.text)}**"
        case blocks.Tiles():
            return "\n".join(
                f"- {plain(t.label)}: **{plain(t.value)}**" + (f" ({plain(t.note)})" if t.note else "")
                for t in block.tiles
            )
        case Chart() | blocks.Picture():
            return f"*{plain(block.title)}.* {plain(block.description)}"
        case blocks.Figures():
            return "\n\n".join(map(_block, block.figures))
        case blocks.Items():
            return "\n".join(_items(block))
        case blocks.Details():
            return "\n\n".join([plain(block.title), *map(_block, block.blocks)])
        case blocks.Listing():
            fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", block.text)), default=0))
            return f"{fence}{block.language}\n{block.text}\n{fence}"
        case blocks.TableBlock():
            head = [plain(title) or " " for title in block.head]
            lines = markdown_table(head, [list(map(_cell, row)) for row in block.rows], block.numbers)
            return "\n".join([*([f"*{plain(block.caption)}*", ""] if block.caption else []), *lines])


def _items(items: blocks.Items) -> Iterator[str]:
    for rank, item in enumerate(items.items, 1):
        said, below = (item, ()) if isinstance(item, str) else (item.text, item.parts)
        yield f"{f'{rank}.' if items.ranked else '-'} {plain(said)}"
        yield from (f"   - {plain(part)}" for part in below)


def plain(text: str) -> str:
    """Text on one line with Markdown characters escaped."""
    return as_markdown(" ".join(text.split()))


def _cell(cell: blocks.Cell) -> str:
    words = plain(cell.text) or " "
    return f"**{words}**" if cell.strong and words.strip() else words
