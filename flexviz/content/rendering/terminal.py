"""Blocks for a terminal, a log or `print`: lines of text and tables of rich."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence

from rich import box
from rich.console import Console
from rich.table import Table as RichTable

from flexviz.content import blocks
from flexviz.content.blocks import Block
from flexviz.content.charts import Chart

WIDE = 110  # columns from which a table has room for what else stands below it
WIDEST = 130  # … and for whole texts
FOLDED, GAP = 10, 2  # columns that a folded text needs, and between two columns
INDENT = 5 * " "  # of what belongs to the line above


def text(content: Iterable[Block], width: int = 140) -> str:
    """All blocks as text, `width` columns wide."""
    console = Console(file=io.StringIO(), width=width, markup=False, highlight=False, emoji=False)
    show(content, console)
    return console.file.getvalue().rstrip("\n")  # type: ignore[attr-defined]


def show(content: Iterable[Block], console: Console) -> None:
    """Print all blocks; lines are not wrapped, so that they can be searched."""
    for part in parts(content, console.width):
        console.print(part, soft_wrap=isinstance(part, str))


def parts(content: Iterable[Block], width: int) -> Iterator[RichTable | str]:
    """Tables, and lines in plain numbers: with a hyphen for a minus sign they can be copied."""
    for block in content:
        if isinstance(block, blocks.TableBlock):
            yield from table_parts(block, width)
        else:
            yield from map(in_ascii, lines(block))


def lines(block: Block) -> Iterator[str]:
    """The lines of any block but a table."""
    match block:
        case blocks.Paragraph() | blocks.Callout() | blocks.Meter() | blocks.Listing():
            yield block.text
        case blocks.Tiles():
            yield from (f"{t.label}: {t.value}" + (f" ({t.note})" if t.note else "") for t in block.tiles)
        case blocks.Items():
            for rank, item in enumerate(block.items, 1):
                said, below = (item, ()) if isinstance(item, str) else (item.text, item.parts)
                yield f"{rank:3d}. {said}" if block.ranked else f"  {said}"
                yield from (INDENT + part for part in below)
        case blocks.Details():
            yield block.title
            yield from (INDENT + line.strip() for one in block.blocks for line in lines(one))
        case Chart():
            yield block.description
        case blocks.Figures():
            yield from (f"{one.title}: {one.description}" for one in block.figures)
        case blocks.TableBlock():
            yield from (" ".join(cell.text for cell in row) for row in block.rows)


def table_parts(table: blocks.TableBlock, width: int) -> Iterator[RichTable | str]:
    """A table with its caption; on a narrow terminal short, in pieces, and with lines below for the rest."""
    below = table.below if width < WIDE else {}
    columns = [column for column in range(len(table.head)) if column not in below]
    if table.caption:
        yield in_ascii(table.caption)
    short = width < WIDEST
    for piece in pieces(table, columns, width, short):
        yield rich_table(table, piece, short)
    if short and table.shorts and any(cell.short for row in table.rows for cell in row):
        yield table.shorts
    for row in table.rows:
        yield from (
            in_ascii(f"{label(row)} {words} {row[c].text}") for c, words in below.items() if row[c].text
        )


def rich_table(table: blocks.TableBlock, columns: Sequence[int], short: bool) -> RichTable:
    """Some columns of a table; texts may fold, numbers stay whole."""
    out = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for column in columns:
        number, breaks = column in table.numbers, column in table.fold or column in table.below
        out.add_column(
            table.head[column],
            justify="right" if number else "left",
            no_wrap=not breaks,
            overflow="fold" if breaks else "ellipsis",
        )
    for index, row in enumerate(table.rows):
        style = "dim" if index in table.faint else ""
        out.add_row(*(cell_text(row[c], short) for c in columns), style=style)
    return out


def cell_text(cell: blocks.Cell, short: bool) -> str:
    """What stands in a cell."""
    return in_ascii(cell.short if short and cell.short else cell.text)


def pieces(table: blocks.TableBlock, columns: Sequence[int], width: int, short: bool) -> Iterator[list[int]]:
    """Columns that fit one below the other; each piece begins with the first column."""

    def least(column: int) -> int:
        texts = [table.head[column], *(cell_text(row[column], short) for row in table.rows)]
        whole = max(map(len, texts)) + GAP
        return min(whole, FOLDED) if column in table.fold or column in table.below else whole

    first, *rest = columns
    piece = [first]
    for column in rest:
        if len(piece) > 1 and sum(map(least, (*piece, column))) > width - 1:
            yield piece
            piece = [first]
        piece.append(column)
    yield piece


def label(row: Sequence[blocks.Cell]) -> str:
    """ "stiffness:joint1": what names a row."""
    return ":".join(cell.text for cell in row[:2] if cell.text)


def in_ascii(text: str) -> str:
    """Replace the minus sign by a hyphen, so that numbers can be copied into a program."""
    return text.replace("−", "-")
