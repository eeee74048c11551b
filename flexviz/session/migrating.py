"""session.json of older versions, made into today's; each function takes a document one format further."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flexviz.errors import InputError
from flexviz.session.saving import FORMAT, OLD_ARRAYS

Document = dict[str, Any]


def migrated(document: Any, folder: Path) -> Document:
    """The document in today's format; InputError for what is no session or was written by a later version."""
    if not isinstance(document, dict):
        raise InputError("it is no table of names")
    found = document.get("format")
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        raise InputError(f'"format" is {found!r}, a whole number from 1 to {FORMAT} would be right')
    if found > FORMAT:
        raise InputError(
            f"written in format {found} by flexviz {document.get('flexviz', 'of a later version')}; "
            f"this one reads up to format {FORMAT}"
        )
    while document["format"] < FORMAT:
        document = MIGRATIONS[document["format"]](document, folder)
    return document


def from_1(document: Document, folder: Path) -> Document:
    """Format 1 lay in a copy of its set, with all arrays in one file; it had no hashes, notes or times."""
    try:
        with zipfile.ZipFile(folder / OLD_ARRAYS) as archive:
            count = len(archive.namelist())
    except (OSError, zipfile.BadZipFile) as error:
        raise InputError(f"{OLD_ARRAYS} cannot be read ({error})") from None
    return document | {
        "format": 2,
        "set": {"name": folder.resolve().name, "path": ".", "absolute": ""},
        "arrays": [{"file": OLD_ARRAYS, "count": count}],
        "notes": [],
        "recordings": [],
    }


MIGRATIONS: dict[int, Callable[[Document, Path], Document]] = {1: from_1}
