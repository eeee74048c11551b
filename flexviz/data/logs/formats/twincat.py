"""Text exports of TwinCAT Scope: lines of metadata, then a time and a value of each channel in turn.

Each line above the numbers holds a key and a value per channel: Name, SymbolName, Data-Type, SampleTime[ms],
Unit … The times are milliseconds after the start of the export.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexviz.data.logs.column_names import known_unit
from flexviz.data.measurements import Array

KEYS = ("Name", "SampleTime[ms]")  # lines that a header has; the others depend on the export's settings
TIME = "time of "  # begins the name of a channel's time column


def scope_header(
    lines: Sequence[str], split: Callable[[str, str], list[str]]
) -> tuple[str, int, list[str], dict[str, str]] | None:
    """Separator, lines before the numbers, names of the columns and their units; None for another file."""
    for separator in ("\t", ";", ","):
        rows = [split(line, separator) for line in lines]
        width = max(map(len, rows), default=0)
        # one key in every other cell of a line
        keyed = {
            row[0]: row[1::2]
            for row in rows
            if len(row) >= width - 1 > 0 and row[0] and len({*row[::2]} - {""}) == 1 and not _number(row[0])
        }
        if all(key in keyed for key in KEYS):
            last = max(i for i, row in enumerate(rows) if row and row[0] in keyed)
            first = next((i for i, row in enumerate(rows) if i > last and row and _number(row[0])), None)
            names = _distinct(keyed["Name"])
            if first is None or not names:
                return None
            stated = [known_unit(text.split(" ")[0]) for text in keyed.get("Unit", [])]
            units = {name: unit for name, unit in zip(names, stated, strict=False) if unit}
            units |= {f"{TIME}{name}": "ms" for name in names}
            return separator, first, [x for name in names for x in (f"{TIME}{name}", name)], units
    return None


def with_one_clock(columns: dict[str, Array]) -> dict[str, Array]:
    """The columns with `time` in place of the channels' times, where these are all the same."""
    times = [x for name, x in columns.items() if name.startswith(TIME)]
    if not times or any(not np.array_equal(times[0], other) for other in times[1:]):
        return columns
    return {"time": times[0], **{name: x for name, x in columns.items() if not name.startswith(TIME)}}


def _distinct(names: Sequence[str]) -> list[str]:
    found: list[str] = []
    for i, name in enumerate(names):
        name = name or f"channel{i + 1}"
        found.append(name if name not in found else f"{name}#{i + 1}")
    return found


def _number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
