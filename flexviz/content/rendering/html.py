"""Blocks as HTML: a page, which is one self-contained file without scripts, and a notebook's output.

All text is escaped on insertion; the content security policy forbids the browser to load or run anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

from flexviz.content import blocks
from flexviz.content.charts import COLOURS, PAGE, Chart, SvgTheme, css, draw_svg, rgb
from flexviz.content.wording import escape, with_terms

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
DARK_SHADE = 0.9  # cells darker than this get white text
SHORT_TABLE = 7  # rows up to which a table is kept on one page
MAX_WORD = 18  # [characters] up to which a column is widened for a word
COLUMN_GAP = 2  # [characters]
PAGE_WIDTH, PAGE_WIDTH_DENSE = 84, 104  # [characters] on A4, in normal and in small print
SIZES = {2: (420, 74), 3: (345, 76)}  # [px] width and left margin of figures in so many columns
MAX_LABEL = 30  # [characters] of a callout's label


def html(document: blocks.ReportDocument) -> str:
    """The whole page; figures are numbered in reading order."""
    style = Path(__file__).with_name("style.css").read_text(encoding="utf-8").partition("\n")[2]
    tags = "".join(f'<span class="tag">{escape(tag)}</span>' for tag in document.tags)
    figures = count(1)
    # keys on a page without scripts: terms can be reached, once in each section
    body = "".join(with_terms(_section(section, 2, figures), focus=True) for section in document.sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(document.title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        f'<header><h1>{escape(document.title)}</h1><p class="sub">{escape(document.subtitle)}</p>'
        f"{f'<p>{tags}</p>' if tags else ''}</header>\n"
        f"{body}<footer>{escape(document.footer)}</footer>\n</main>\n</body>\n</html>\n"
    )


def html_fragment(content: Iterable[blocks.Block]) -> str:
    """Blocks without page and style, for a notebook."""
    figures = count(1)
    return "".join(_block(block, figures) for block in content)


def _section(section: blocks.Section, level: int, figures: Iterator[int]) -> str:
    lines = [f"<h{level}>{escape(section.title)}</h{level}>"] if section.title else []
    lines += [_block(block, figures) for block in section.blocks]
    lines += [_section(part, level + 1, figures) for part in section.parts]
    return "\n".join(["<section>", *lines, "</section>"])


def _block(block: blocks.Block, figures: Iterator[int]) -> str:
    match block:
        case blocks.Paragraph():
            kind = ' class="quiet"' if block.quiet else ""
            words = f"<b>{escape(block.text)}</b>" if block.strong else escape(block.text)
            return f"<p{kind}>{words}</p>"
        case blocks.Meter():
            return f"<p>{escape(block.text)}</p>"
        case blocks.Callout():
            label, colon, rest = block.text.partition(":")
            labelled = colon and len(label) < MAX_LABEL
            shown = f"<b>{escape(label)}:</b>{escape(rest)}" if labelled else escape(block.text)
            role = ' role="note"' if block.tone == "warn" else ""
            return f'<p class="callout {escape(block.tone)}"{role}>{shown}</p>'
        case blocks.Tiles():
            cells = "".join(
                f'<div><dt>{escape(t.label)}</dt><dd class="value">{escape(t.value)}</dd>'
                f'<dd class="note">{escape(t.note)}</dd></div>'
                for t in block.tiles
            )
            return f'<dl class="tiles">{cells}</dl>'
        case Chart():
            return _figure(block, block.description, figures, PAGE)
        case blocks.Figures():
            columns = max(min(block.columns, len(block.figures)), 2)
            width, left = SIZES[columns]
            theme = replace(PAGE, width=width, left=left)
            cells = (_figure(one, _note(one), figures, theme) for one in block.figures)
            return f'<div class="figures of{columns}">{"".join(cells)}</div>'
        case blocks.Items():
            return items_html(block)
        case blocks.Details():
            inside = "".join(_block(one, figures) for one in block.blocks)
            return f"<details><summary>{escape(block.title)}</summary>{inside}</details>"
        case blocks.Listing():
            return f"<pre><code>{escape(block.text)}</code></pre>"
        case blocks.TableBlock():
            return _table(block)


def items_html(items: blocks.Items) -> str:
    """A list, and what is told below its entries."""

    def entry(item: str | blocks.Item) -> str:
        if isinstance(item, str):
            return f"<li>{escape(item)}</li>"
        below = "".join(f"<div>{escape(part)}</div>" for part in item.parts)
        return f"<li>{escape(item.text)}{below}</li>"

    kind = "ol" if items.ranked else "ul"
    return f"<{kind}>{''.join(map(entry, items.items))}</{kind}>"


def _figure(figure: Chart | blocks.Picture, text: str, figures: Iterator[int], theme: SvgTheme) -> str:
    number = next(figures)
    key = f"f{number}"
    svg = draw_svg(figure, key, theme) if isinstance(figure, Chart) else _drawing(figure, key, theme)
    caption = f"<b>Figure {number}. {escape(figure.title)}.</b> {escape(text)}"
    return f"<figure>{svg}<figcaption>{caption}</figcaption></figure>"


def _drawing(picture: blocks.Picture, key: str, theme: SvgTheme) -> str:
    width, height = picture.size
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        f'aria-labelledby="{key}-t {key}-d" fill="{theme.ink}">',
        f'<title id="{key}-t">{escape(picture.title)}</title>',
        f'<desc id="{key}-d">{escape(picture.description)}</desc>',
        *picture.elements,
        "</svg>",
    ]
    return "\n".join(lines)


def _note(figure: Chart | blocks.Picture) -> str:
    return figure.note if isinstance(figure, Chart) else figure.description


def _table(table: blocks.TableBlock) -> str:
    widths, dense = column_widths(table)
    kinds = [' class="n"' if i in table.numbers else "" for i in range(len(table.head))]
    head = "".join(
        f'<th scope="col"{kind}>{escape(title)}</th>'
        if kind  # its cells are not broken
        else f'<th scope="col" style="min-width:{width}ch">{escape(title)}</th>'
        for kind, width, title in zip(kinds, widths, table.head, strict=True)
    )
    rows = "".join(
        f"<tr>{''.join(_cell(cell, i in table.numbers) for i, cell in enumerate(row))}</tr>"
        for row in table.rows
    )
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    kind = " ".join(["dense"] * dense + ["short"] * (len(table.rows) <= SHORT_TABLE))
    body = f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody>"
    return f'<div class="wide"><table class="{kind}">{caption}{body}</table></div>'


def column_widths(table: blocks.TableBlock) -> tuple[list[int], bool]:
    """Minimum width of each column [characters] such that words stay whole if the page is wide enough.

    Numbers are never broken; the widest text columns shrink first. The second value is True for small print.
    """
    widths = [_width(table, i) for i in range(len(table.head))]
    dense = table.dense or sum(widths) > PAGE_WIDTH
    room = PAGE_WIDTH_DENSE if dense else PAGE_WIDTH
    texts = [i for i in range(len(widths)) if i not in table.numbers]
    while sum(widths) > room and texts:
        widest = max(texts, key=lambda i: widths[i])
        if widths[widest] <= COLUMN_GAP + 1:
            break
        widths[widest] -= 1
    return widths, dense


def _width(table: blocks.TableBlock, column: int) -> int:
    """Width of a column's longest word or number, at most `MAX_WORD`, with its gap [characters]."""
    words = table.head[column].split()
    for row in table.rows:
        words += [row[column].text] if column in table.numbers else row[column].text.split()
    return min(max(map(len, words), default=1), MAX_WORD) + COLUMN_GAP


def _cell(cell: blocks.Cell, number: bool) -> str:
    words = f"<b>{escape(cell.text)}</b>" if cell.strong else escape(cell.text)
    classes, style = ["n"] if number else [], ""
    if cell.shade is not None:
        classes.append("heat")
        ink = "#fff" if cell.shade > DARK_SHADE else "#000"
        style = f' style="background:{shaded(cell.shade)};color:{ink}"'
    kind = f' class="{" ".join(classes)}"' if classes else ""
    tip = f' title="{escape(cell.tip)}"' if cell.tip else ""
    return f"<td{kind}{tip}{style}>{words}</td>"


def shaded(share: float) -> str:
    """Background from white (0) to the colour of measured data (1)."""
    red, green, blue = (round(255 + share * (value - 255)) for value in rgb(COLOURS.measured))
    return css((red, green, blue))
