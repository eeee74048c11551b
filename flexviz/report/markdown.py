"""A report as Markdown: the same texts and tables; a chart is told in words."""

from __future__ import annotations

import re

from flexviz.report.blocks import (
    Block,
    Callout,
    Cell,
    Code,
    Document,
    Figure,
    Inline,
    Items,
    Listing,
    Paragraph,
    Section,
    Strong,
    Table,
    Tiles,
)

SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~])")


def markdown(document: Document, footer: str) -> str:
    """The whole text."""
    parts = [f"# {plain(document.title)}", plain(document.subtitle)]
    if document.tags:
        parts.append(" · ".join(f"*{plain(tag)}*" for tag in document.tags))
    parts += [_section(section, 2) for section in document.sections]
    return "\n\n".join([*parts, "---", plain(footer)]) + "\n"


def plain(text: str) -> str:
    """A text on one line in which nothing is markup."""
    return SPECIAL.sub(r"\\\1", " ".join(text.split()))


def _section(section: Section, level: int) -> str:
    parts = [f"{'#' * level} {plain(section.title)}"] if section.title else []
    parts += [_block(block) for block in section.blocks]
    parts += [_section(part, level + 1) for part in section.parts]
    return "\n\n".join(parts)


def _block(block: Block) -> str:
    match block:
        case Paragraph(parts, _):
            return "".join(_inline(part) for part in parts)
        case Callout(words, _):
            return f"> **{plain(words)}**"
        case Tiles(tiles):
            return "\n".join(
                f"- {plain(t.label)}: **{plain(t.value)}**" + (f" ({plain(t.note)})" if t.note else "")
                for t in tiles
            )
        case Table():
            return _table(block)
        case Figure(chart):
            return f"*{plain(chart.title)}.* {plain(chart.description)}"
        case Items(items):
            return "\n".join(f"- {''.join(_inline(part) for part in item)}" for item in items)
        case Listing(words, language):
            fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", words)), default=0))
            return f"{fence}{language}\n{words}\n{fence}"


def _inline(part: Inline) -> str:
    match part:
        case Strong(words):
            return f"**{plain(words)}**"
        case Code(words):
            return f"`{' '.join(words.split()).replace('`', chr(39))}`"
        case _:
            lead, trail = " " * part[:1].isspace(), " " * (part[-1:].isspace() and len(part) > 1)
            return f"{lead}{plain(part)}{trail}"


def _table(table: Table) -> str:
    numbers = set(table.numbers)
    rule = ["---:" if i in numbers else "---" for i in range(len(table.head))]
    lines = [f"| {' | '.join(plain(title) or ' ' for title in table.head)} |", f"|{'|'.join(rule)}|"]
    lines += [f"| {' | '.join(_cell(cell) for cell in row)} |" for row in table.rows]
    title = [f"*{plain(table.caption)}*", ""] if table.caption else []
    return "\n".join([*title, *lines])


def _cell(cell: Cell) -> str:
    words = plain(cell.text) or " "
    return f"**{words}**" if cell.strong and words.strip() else words
