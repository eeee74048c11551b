"""Reading a results document from a JSON or YAML file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from flexviz.errors import InputError
from flexviz.results.document import ResultDocument
from flexviz.schemas import input_error

LARGEST_BYTES = 50_000_000
SUFFIXES = (".json", ".yaml", ".yml")


def read_result(file: str | Path) -> ResultDocument:
    """A result file, as `identify --json`, `diagnose --json` or `export` wrote it.

    Raises:
        InputError: naming file and place, if it is not a valid result file.
    """
    file = Path(file)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"not a result file, expected {' or '.join(SUFFIXES[:2])}", file=file)
    try:
        if file.stat().st_size > LARGEST_BYTES:
            raise InputError(f"larger than {LARGEST_BYTES:,} bytes, expected a result", file=file)
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=file) from None
    try:
        data = json.loads(text) if suffix == ".json" else _yaml(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not valid {suffix[1:].upper()} ({error})", file=file) from None
    return checked(data, file)


def checked(data: Any, file: Path) -> ResultDocument:
    """The validated document of `data` from `file`."""
    if not isinstance(data, dict) or not {"parameters", "model"} & data.keys():
        raise InputError(
            'holds no "parameters"; expected what "flexviz identify --json", "flexviz diagnose --json" or '
            '"flexviz export" write',
            file=file,
        )
    try:
        return ResultDocument.from_dict(data)
    except ValidationError as error:
        raise input_error(error, data, file) from None


def _yaml(text: str) -> Any:
    from ruamel.yaml import YAML, YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        raise ValueError(str(error)) from None
