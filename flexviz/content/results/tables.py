"""Tables and numbers of a result for terminals."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table

from flexviz.content import wording


def interval(value: float, std: float | None) -> tuple[str, str]:
    """A value and half its 95 % interval, rounded to the second digit of the interval."""
    shown, half = wording.interval(value, std)
    return in_ascii(shown), half


def plain_table(*texts: str, numbers: Sequence[str] = (), end: Sequence[str] = ()) -> Table:
    """An empty table: columns of text, of numbers, and of text again."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for title in (*texts, *numbers, *end):
        table.add_column(title, justify="right" if title in numbers else "left", no_wrap=True)
    return table


def fold(table: Table, column: int) -> None:
    """Let a column of long names break, so that the numbers stay whole."""
    table.columns[column].no_wrap, table.columns[column].overflow = False, "fold"


def in_ascii(text: str) -> str:
    """Replace the minus sign by a hyphen, so that numbers can be copied into a program."""
    return text.replace("−", "-")
