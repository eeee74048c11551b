"""How large a file may be, checked before it is read: a small file can stand for much memory."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError

LARGEST_TEXT = 256 * 2**20  # [bytes] of a JSON file
LARGEST_LOG = 2**30  # [bytes] of a JSON log: 7 joints at 1 kHz for 10 min are a quarter to a half of it
LARGEST_NUMBERS = 2**28  # of a table in memory: 2 GiB
LARGEST_UNPACKED = 2 * 2**30  # [bytes] of a compressed file


def check_size(file: Path, largest: int, what: str) -> None:
    """InputError for a larger file; OSError if it cannot be reached."""
    if (size := file.stat().st_size) > largest:
        raise InputError(f"{size:,} bytes, expected {what} of at most {largest:,}", file=file)


def check_numbers(rows: int, columns: int, file: Path) -> None:
    """InputError for a table that would take too much memory."""
    if rows * columns > LARGEST_NUMBERS:
        found = f"{rows * columns:,} numbers"
        raise InputError(f"{found}, expected at most {LARGEST_NUMBERS:,}", file=file)


def read_json(file: Path, largest: int = LARGEST_TEXT) -> Any:
    """The content of a JSON file; InputError, or OSError if it cannot be reached."""
    check_size(file, largest, "a JSON file")
    try:
        return json.loads(file.read_text(encoding="utf-8-sig"))
    except RecursionError:
        raise InputError("not valid JSON: its values are nested too deeply", file=file) from None
    except ValueError as error:  # also bytes that are no UTF-8, and whole numbers of over 4300 digits
        raise InputError(f"not valid JSON: {error}", file=file) from None


def check_npz(file: Path) -> None:
    """InputError for an archive of arrays that says it is larger, as a whole or in an array's header."""
    with zipfile.ZipFile(file) as archive:
        total = sum(info.file_size for info in archive.infolist())
        if total > LARGEST_UNPACKED:
            message = f"{total:,} bytes unpacked, expected at most {LARGEST_UNPACKED:,}"
            raise InputError(message, file=file)
        for info in archive.infolist():
            with archive.open(info) as stream:
                version = np.lib.format.read_magic(stream)
                one = version == (1, 0)
                read = np.lib.format.read_array_header_1_0 if one else np.lib.format.read_array_header_2_0
                shape, _, kind = read(stream)
            count = int(np.prod([int(length) for length in shape], dtype=object))
            if not kind.hasobject and count * kind.itemsize > info.file_size:
                message = f"its array of shape {shape} does not fit into {info.file_size:,} bytes"
                raise InputError(message, file=file, place=info.filename)
