"""A report as Markdown; charts become their descriptions."""

from __future__ import annotations

import re
from collections.abc import Sequence

from flexviz.charts import Chart
from flexviz.report.blocks import (
    Callout,
    Cell,
    Items,
    Listing,
    Paragraph,
    ReportDocument,
    ReportTable,
    ReportWriter,
    Tiles,
)

SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~])")


class MarkdownWriter(ReportWriter):
    """Markdown writer; values are escaped."""

    def document(self, document: ReportDocument) -> str:
        """The whole text."""
        parts = [f"# {plain(document.title)}", plain(document.subtitle)]
        if document.tags:
            parts.append(" · ".join(f"*{plain(tag)}*" for tag in document.tags))
        parts += [self.walk(section) for section in document.sections]
        return "\n\n".join([*parts, "---", plain(document.footer)]) + "\n"

    def section(self, title: str, level: int, contents: Sequence[str]) -> str:
        heading = [f"{'#' * level} {plain(title)}"] if title else []
        return "\n\n".join([*heading, *contents])

    def paragraph(self, block: Paragraph) -> str:
        return plain(block.text)

    def callout(self, block: Callout) -> str:
        return f"> **{plain(block.text)}**"

    def tiles(self, block: Tiles) -> str:
        return "\n".join(
            f"- {plain(t.label)}: **{plain(t.value)}**" + (f" ({plain(t.note)})" if t.note else "")
            for t in block.tiles
        )

    def chart(self, block: Chart) -> str:
        return f"*{plain(block.title)}.* {plain(block.description)}"

    def items(self, block: Items) -> str:
        return "\n".join(f"- {plain(item)}" for item in block.items)

    def listing(self, block: Listing) -> str:
        fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", block.text)), default=0))
        return f"{fence}{block.language}\n{block.text}\n{fence}"

    def table(self, block: ReportTable) -> str:
        rule = ["---:" if i in block.numbers else "---" for i in range(len(block.head))]
        lines = [f"| {' | '.join(plain(title) or ' ' for title in block.head)} |", f"|{'|'.join(rule)}|"]
        lines += [f"| {' | '.join(_cell(cell) for cell in row)} |" for row in block.rows]
        title = [f"*{plain(block.caption)}*", ""] if block.caption else []
        return "\n".join([*title, *lines])


def plain(text: str) -> str:
    """Text on one line with Markdown characters escaped."""
    return SPECIAL.sub(r"\\\1", " ".join(text.split()))


def _cell(cell: Cell) -> str:
    words = plain(cell.text) or " "
    return f"**{words}**" if cell.strong and words.strip() else words
