"""JSON logs: tables of lists, or a list of records (also one record per line)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.limits import LARGEST_LOG, check_size, read_json
from flexviz.data.logs.formats.arrays import IN_PYTHON, Flattening
from flexviz.data.logs.formats.base import SHORTEST, Log, LogFormat, ReadOptions
from flexviz.data.measurements import readable


def read_json_log(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers."""
    with readable(path, "JSON log"):
        if path.suffix.lower() == ".json":
            content = read_json(path, LARGEST_LOG)
        else:
            check_size(path, LARGEST_LOG, "a JSON log")
            with path.open(encoding="utf-8-sig") as lines:
                content = [json.loads(line) for line in lines if line.strip()]
        content = arrays_of(content)
    return Flattening(*IN_PYTHON).log(
        path, "JSON", content if isinstance(content, dict) else {"data": content}
    )


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
