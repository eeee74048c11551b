"""Blocks for the narrow panels of the app, for its style sheet (`outlets/app/style.py`); text is escaped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from flexviz.content import blocks
from flexviz.content.charts import COLOURS, Chart, rgb
from flexviz.content.rendering.html import items_html
from flexviz.content.wording import escape

BRIGHT_SHARE = 0.87  # of the colour of a cell, above which black reads better on it than white
VERDICTS = {"good": "nothing-missing"}  # tone of a callout -> class of the style sheet


def panel(content: Iterable[blocks.Block], kind: str = "") -> str:
    """Blocks in one element of class `kind`; "" without any."""
    inside = "".join(map(_block, content))
    return f'<div class="{f"fv {kind}".strip()}">{inside}</div>' if inside else ""


def _block(block: blocks.Block) -> str:
    match block:
        case blocks.Paragraph():
            words = f"<b>{escape(block.text)}</b>" if block.strong else escape(block.text)
            return f'<div class="fv-dim">{words}</div>' if block.quiet else f"<div>{words}</div>"
        case blocks.Callout():
            return _callout(block)
        case blocks.Meter():
            share = 100 * min(max(block.share, 0.0), 1.0)
            likely = " fv-likely" if block.strong else ""
            bar = f'<div class="fv-bar{likely}"><span style="width:{share:.0f}%"></span></div>'
            return f"{bar}<div>{escape(block.text)}</div>"
        case blocks.Tiles():
            return "".join(
                f'<div title="{escape(t.note)}">{escape(t.label)} <b>{escape(t.value)}</b></div>'
                for t in block.tiles
            )
        case blocks.Items():
            return items_html(block)
        case blocks.Details():
            inside = "".join(map(_block, block.blocks))
            return f'<details class="fv-card"><summary>{escape(block.title)}</summary>{inside}</details>'
        case blocks.Listing():
            return f'<pre class="fv-equation">{escape(block.text)}</pre>'
        case blocks.TableBlock():
            return _table(block)
        case Chart():
            return f'<div class="fv-dim">{escape(block.description)}</div>'
        case blocks.Figures():
            return "".join(f'<div class="fv-dim">{escape(one.description)}</div>' for one in block.figures)


def _callout(block: blocks.Callout) -> str:
    if block.tone == "warn":
        return f'<div class="fv-warn">{escape(block.text)}</div>'
    words = f"<s>{escape(block.text)}</s>" if block.tone == "old" else escape(block.text)
    tone = VERDICTS.get(block.tone, "fv-old" if block.tone == "old" else block.tone)
    return f'<div class="fv-verdict {tone}">{words}</div>'


def _table(table: blocks.TableBlock) -> str:
    """What a row has `below` follows it; what rows share in a `group` stands once above them."""
    group = table.group
    columns = [c for c in range(len(table.head)) if c not in table.below and c != group]
    titles = "".join(f"<th>{escape(table.head[c])}</th>" for c in columns)
    rows, shared = [f"<tr>{titles}</tr>"] if any(table.head) else [], None
    order = [] if group is None else list(dict.fromkeys(row[group].text for row in table.rows))
    for row in table.rows if group is None else sorted(table.rows, key=lambda r: order.index(r[group].text)):
        if group is not None and row[group].text != shared:
            shared = row[group].text
            name = escape(shared or "all joints")
            rows.append(f'<tr class="fv-group"><td colspan="{len(columns)}">{name}</td></tr>')
        tip = f' title="{escape(row[columns[0]].tip)}"' if row[columns[0]].tip else ""
        first, *others = (row[c] for c in columns)
        rows.append(f"<tr{tip}>{_cell(replace(first, tip=''))}{''.join(map(_cell, others))}</tr>")
        for c, words in table.below.items():
            if row[c].text:
                look = "fv-tied fv-warn" if row[c].strong else "fv-tied"
                said = escape(f"{words} {row[c].text}")
                rows.append(f'<tr class="{look}"><td colspan="{len(columns)}">↳ {said}</td></tr>')
    heat = " fv-heat" if any(cell.shade is not None for row in table.rows for cell in row) else ""
    left = "" if table.numbers else " fv-left"
    caption = f"<b>{escape(table.caption)}</b>" if table.caption else ""
    return f'{caption}<table class="fv-table{heat}{left}">{"".join(rows)}</table>'


def _cell(cell: blocks.Cell) -> str:
    words = f"<b>{escape(cell.text)}</b>" if cell.strong else escape(cell.text)
    tip = f' title="{escape(cell.tip)}"' if cell.tip else ""
    tone = f' class="fv-{escape(cell.tone)}"' if cell.tone else ""
    if cell.shade is None:
        return f"<td{tone}{tip}>{words}</td>"
    red, green, blue = rgb(COLOURS.playhead)
    ink = ";color:#000" if cell.shade > BRIGHT_SHARE else ""
    return f'<td style="background:rgb({red} {green} {blue} / {cell.shade:.2f}){ink}"{tip}>{words}</td>'
