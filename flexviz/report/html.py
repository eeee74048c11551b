"""A report as one HTML file: everything in it, nothing loaded from anywhere, no script.

Every text is escaped where it is put in; the page's own policy forbids the browser to load or run anything.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from flexviz.charts import COLOURS, css, rgb, svg
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
from flexviz.report.style import CSS
from flexviz.wording import escape

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
DARK = 0.9  # shade from which white ink is read better
SHORT = 16  # rows of a table that a page break does not cut
WORD = 18  # characters of a word that a column is at least made for
GAP = 2  # characters of room beside it
PAPER, PAPER_DENSE = 84, 104  # characters across A4, in normal and in small print


def html(document: Document, footer: str) -> str:
    """The whole page."""
    figures = count(1)
    tags = "".join(f'<span class="tag">{escape(tag)}</span>' for tag in document.tags)
    body = "".join(_section(section, 2, figures) for section in document.sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(document.title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<main>\n"
        f'<header><h1>{escape(document.title)}</h1><p class="sub">{escape(document.subtitle)}</p>'
        f"{f'<p>{tags}</p>' if tags else ''}</header>\n"
        f"{body}<footer>{escape(footer)}</footer>\n</main>\n</body>\n</html>\n"
    )


def _section(section: Section, level: int, figures: Iterator[int]) -> str:
    title = f"<h{level}>{escape(section.title)}</h{level}>\n" if section.title else ""
    blocks = "".join(f"{_block(block, figures)}\n" for block in section.blocks)
    parts = "".join(_section(part, min(level + 1, 6), figures) for part in section.parts)
    return f"<section>\n{title}{blocks}{parts}</section>\n"


def _block(block: Block, figures: Iterator[int]) -> str:
    match block:
        case Paragraph(parts, quiet):
            kind = ' class="quiet"' if quiet else ""
            return f"<p{kind}>{_inlines(parts)}</p>"
        case Callout(words, tone):
            start, colon, rest = words.partition(":")
            shown = f"<b>{escape(start)}:</b>{escape(rest)}" if colon and len(start) < 30 else escape(words)
            role = ' role="note"' if tone == "warn" else ""
            return f'<p class="callout {escape(tone)}"{role}>{shown}</p>'
        case Tiles(tiles):
            cells = "".join(
                f'<div><dt>{escape(t.label)}</dt><dd class="value">{escape(t.value)}</dd>'
                f'<dd class="note">{escape(t.note)}</dd></div>'
                for t in tiles
            )
            return f'<dl class="tiles">{cells}</dl>'
        case Table():
            return _table(block)
        case Figure(chart):
            number = next(figures)
            caption = f"<b>Figure {number}. {escape(chart.title)}.</b> {escape(chart.description)}"
            return f"<figure>{svg(chart, f'f{number}')}<figcaption>{caption}</figcaption></figure>"
        case Items(items):
            return f"<ul>{''.join(f'<li>{_inlines(item)}</li>' for item in items)}</ul>"
        case Listing(words, _):
            return f"<pre><code>{escape(words)}</code></pre>"


def _inlines(parts: tuple[Inline, ...]) -> str:
    return "".join(_inline(part) for part in parts)


def _inline(part: Inline) -> str:
    match part:
        case Strong(words):
            return f"<b>{escape(words)}</b>"
        case Code(words):
            return f"<code>{escape(words)}</code>"
        case _:
            return escape(part)


def _table(table: Table) -> str:
    numbers = set(table.numbers)
    widths, dense = fitted(table)
    kinds = [' class="n"' if i in numbers else "" for i in range(len(table.head))]
    head = "".join(
        f'<th scope="col"{kind} style="min-width:{width}ch">{escape(title)}</th>'
        for kind, width, title in zip(kinds, widths, table.head, strict=True)
    )
    rows = "".join(
        f"<tr>{''.join(_cell(cell, i in numbers) for i, cell in enumerate(row))}</tr>" for row in table.rows
    )
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    classes = [*(["dense"] if dense else []), *(["short"] if len(table.rows) <= SHORT else [])]
    kind = f' class="{" ".join(classes)}"' if classes else ""
    body = f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody>"
    return f'<div class="wide"><table{kind}>{caption}{body}</table></div>'


def fitted(table: Table) -> tuple[list[int], bool]:
    """Least width of each column [characters], so that words stay whole where paper has room for them.

    A number is never broken; of texts the longest words give way first. The second value: in small print.
    """
    fixed = set(table.numbers)
    widths = [_width(table, i, i in fixed) for i in range(len(table.head))]
    dense = table.dense or sum(widths) > PAPER
    room = PAPER_DENSE if dense else PAPER
    while sum(widths) > room:
        widest = max((i for i in range(len(widths)) if i not in fixed), key=lambda i: widths[i], default=None)
        if widest is None or widths[widest] <= GAP + 1:
            break
        widths[widest] -= 1
    return widths, dense


def _cell(cell: Cell, number: bool) -> str:
    words = f"<b>{escape(cell.text)}</b>" if cell.strong else escape(cell.text)
    classes = ["n"] if number else []
    style = ""
    if cell.shade is not None:
        classes.append("heat")
        ink = "#fff" if cell.shade > DARK else "#000"
        style = f' style="background:{shaded(cell.shade)};color:{ink}"'
    kind = f' class="{" ".join(classes)}"' if classes else ""
    return f"<td{kind}{style}>{words}</td>"


def shaded(share: float) -> str:
    """White for 0, the colour of measured data for 1: little ink where there is little to see."""
    red, green, blue = (round(255 + share * (value - 255)) for value in rgb(COLOURS.measured))
    return css((red, green, blue))


def _width(table: Table, column: int, number: bool) -> int:
    """Characters that a column needs: its longest word, or its longest number, within reason."""
    words = table.head[column].split()
    for row in table.rows:
        words += [row[column].text] if number else row[column].text.split()
    return min(max(map(len, words), default=1), WORD) + GAP
