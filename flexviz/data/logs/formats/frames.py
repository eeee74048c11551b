"""XML frames, one after the other, as KUKA RSI sends them: `<Rob><AIPos A1="…"/><IPOC>…</IPOC></Rob>`.

A column is called `AIPos.A1` for an attribute and `IPOC` for an element that holds a number.
"""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.limits import LARGEST_LOG, check_numbers, check_size
from flexviz.data.logs.formats.base import Log, LogFormat, LogTable, ReadOptions, check_rows, check_stop
from flexviz.data.measurements import RecordError, cut_off, first_damage, readable

END = b"</Rob>"
FRAME = re.compile(r"<(Rob|Sen)\b[^>]*>(.*?)</\1>", re.DOTALL)
PART = re.compile(r"<(\w+)((?:\s+\w+\s*=\s*[\"'][^\"']*[\"'])*)\s*(?:/>|>([^<>]*)</\1>)")
ATTRIBUTE = re.compile(r"(\w+)\s*=\s*[\"']([^\"']*)[\"']")
CHECK_EVERY = 5000  # frames between two looks at should_stop


def read_frames(path: Path, options: ReadOptions) -> Log:
    """All numbers of the frames that the robot sent; frames without a value get NaN."""
    with readable(path, "log of XML frames"):
        check_size(path, LARGEST_LOG, "a log of XML frames")
        text, notes = whole_frames(path)
    rows: list[dict[str, float]] = []
    sent = [frame for frame in FRAME.finditer(text) if frame[1] == "Rob"]
    for number, frame in enumerate(sent):
        if number % CHECK_EVERY == 0:
            check_stop(options.should_stop)
        rows.append(dict(_numbers(frame[2])))
    if not rows:
        raise InputError("no frames <Rob> … </Rob> were found, expected those of KUKA RSI", file=path)
    check_rows(len(rows), path)
    names = list(dict.fromkeys(name for row in rows for name in row))
    check_numbers(len(rows), len(names), path)
    columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    units = {"IPOC": "ms"} if "IPOC" in columns else {}  # counts the controller's milliseconds
    return Log(path, "XML frames", (LogTable("", columns, None, units),), notes=notes)


def whole_frames(path: Path) -> tuple[str, tuple[str, ...]]:
    """The text without what a power cut has left at its end, and a note on that.

    Raises:
        InputError: a frame is damaged.
    """
    with path.open("rb") as stream:
        cut = cut_off(stream, not_a_frame, end=END)
        stream.seek(0)
        text = stream.read(None if cut is None else cut.end)
    if damage := first_damage(BytesIO(text), not_a_frame, end=END):
        raise damage.error(path, "frame")
    notes = () if cut is None else (Fact("cut-off", values={"zeros": cut.zeros, "record": cut.found}).text,)
    return text.decode("utf-8-sig", "replace"), notes


def not_a_frame(text: str, ended: bool) -> None:
    """RecordError for text up to the end of a frame; after the last one other elements may end."""
    begun = text.count("<Rob")
    if begun != int(ended):
        raise RecordError(f"{begun} beginnings of a frame before its end", "one", remedy="delete it")


def _numbers(frame: str) -> list[tuple[str, float]]:
    found = []
    for part in PART.finditer(frame):
        values = [(f"{part[1]}.{name}", text) for name, text in ATTRIBUTE.findall(part[2])]
        values += [(part[1], part[3])] if part[3] else []
        for name, text in values:
            try:
                found.append((name, float(text)))
            except ValueError:
                continue
    return found


FRAMES = LogFormat("XML frames of KUKA RSI", read_frames, suffixes=(".xml",), named=True)
