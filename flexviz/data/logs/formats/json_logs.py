"""JSON logs: tables of lists, or a list of records (also one record per line)."""

from __future__ import annotations

import json
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.facts import Fact
from flexviz.base.limits import LARGEST_LOG, check_size, read_json
from flexviz.data.logs.formats.arrays import IN_PYTHON, Flattening
from flexviz.data.logs.formats.base import SHORTEST, Log, LogFormat, ReadOptions
from flexviz.data.measurements import RecordError, cut_off, first_damage, readable


def read_json_log(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers."""
    notes: tuple[str, ...] = ()
    with readable(path, "JSON log"):
        if path.suffix.lower() == ".json":
            content = read_json(path, LARGEST_LOG)
        else:
            check_size(path, LARGEST_LOG, "a JSON log")
            content, notes = read_lines(path)
        content = arrays_of(content)
    log = Flattening(*IN_PYTHON).log(
        path, "JSON", content if isinstance(content, dict) else {"data": content}
    )
    return replace(log, notes=(*log.notes, *notes))


def read_lines(path: Path) -> tuple[list[Any], tuple[str, ...]]:
    """The records of a file with one in each line, without what a power cut left; and a note on that."""
    with path.open("rb") as stream:
        cut = cut_off(stream, not_json)
        stream.seek(0)
        text = stream.read(None if cut is None else cut.end)
    notes = () if cut is None else (Fact("cut-off", values={"zeros": cut.zeros, "record": cut.found}).text,)
    try:
        return [json.loads(line) for line in text.decode("utf-8-sig").split("\n") if line.strip()], notes
    except ValueError:
        if damage := first_damage(BytesIO(text), not_json):
            raise damage.error(path) from None
        raise


def not_json(text: str, ended: bool) -> None:
    """RecordError for a line that holds no record."""
    try:
        json.loads(text.removeprefix("\ufeff"))
    except ValueError as error:
        raise RecordError(f'"{text[:40]}" ({error})', "one JSON record per line") from None


def arrays_of(value: Any) -> Any:
    """Lists of numbers as arrays, long lists of records as a record of arrays; null becomes NaN."""
    if isinstance(value, dict):
        return {str(key): arrays_of(inside) for key, inside in value.items()}
    if not isinstance(value, list):
        return value
    if len(value) >= SHORTEST and all(isinstance(record, dict) for record in value):
        keys = dict.fromkeys(key for record in value for key in record)
        return {key: arrays_of([record.get(key) for record in value]) for key in keys}
    if len(value) >= SHORTEST and all(isinstance(row, list) and row for row in value):
        lengths, first = {len(row) for row in value}, value[0]
        if len(lengths) == 1 and all(isinstance(one, dict) for one in first):  # records of each motor
            return [arrays_of([row[i] for row in value]) for i in range(len(first))]
    try:
        array = np.array(value)  # whole numbers stay exact
        array = array if array.dtype != object else np.array(value, dtype=float)
    except (ValueError, TypeError):
        return [arrays_of(inside) for inside in value]
    return array if array.dtype.kind in "biuf" else "text"


JSON = LogFormat("JSON", read_json_log, suffixes=(".json", ".jsonl"), named=True)
