"""Tables: rows of texts, the first row is the head."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from flexviz.content.wording import markdown_table

T = TypeVar("T")
Table = list[list[str]]
NONE = "–"


def plain(table: Table, indent: str = "  ") -> str:
    """Columns aligned, the first to the left."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for first, *rest in table:
        cells = [first.ljust(widths[0]), *(c.rjust(w) for c, w in zip(rest, widths[1:], strict=True))]
        lines.append(indent + "  ".join(cells).rstrip())
    return "\n".join(lines)


def markdown(table: Table, numbers: bool = True) -> str:
    """The same in Markdown; `numbers`: all columns but the first are aligned right."""
    head, *rows = table
    return "\n".join(markdown_table(head, rows, range(1, len(head)) if numbers else ()))


@dataclass(frozen=True)
class Share:
    """How many of how many."""

    hits: int
    count: int

    @property
    def value(self) -> float:
        """Share, NaN of nothing."""
        return self.hits / self.count if self.count else float("nan")

    @property
    def text(self) -> str:
        """Never rounded up to a limit: 97.96 % is 97.9 %."""
        if not self.count:
            return NONE
        return f"{self.hits}/{self.count} ({np.floor(1000 * self.hits / self.count) / 10:.1f} %)"


def share(items: Iterable[T], hit: Callable[[T], bool | None] = bool) -> Share:
    """How many are hits, of those for which `hit` is not None."""
    asked = [found for item in items if (found := hit(item)) is not None]
    return Share(sum(asked), len(asked))


def quantile(values: Sequence[float], q: float) -> float:
    """NaN of nothing."""
    return float(np.quantile(values, q)) if len(values) else float("nan")


def quantiles(values: Sequence[float], form: str = ".3g") -> list[str]:
    """Median and 90 % quantile as texts."""
    return [number(quantile(values, q), form) for q in (0.5, 0.9)]


def number(value: float | None, form: str = ".3g") -> str:
    """A number, or a dash for None and NaN."""
    return NONE if value is None or value != value else format(value, form)


def percent(value: float) -> str:
    """0.0123 → "1.2 %"."""
    return NONE if value != value else f"{100 * value:.2g} %"
