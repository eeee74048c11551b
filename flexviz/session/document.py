"""The file session.json: its format, and migrations from older formats."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flexviz.errors import InputError

SESSION_FILE = "session.json"
FORMAT = 3
OLD_ARRAYS = "session.npz"  # of format 1
LARGEST_BYTES = 200_000_000

RENAMED = {
    "Stair": "ModelStep",
    "Place": "ResidualLocation",
    "FreeForm": "FreeCurve",
    "Guard": "BandwidthCheck",
    "Step": "SessionStep",
    "Note": "SessionNote",
}  # classes as format 2 wrote them
RENAMED_FIELDS = {"stairs": "model_steps", "free_form": "free_curve"}
NOTE_BEGINNINGS = {
    "no model reaches the measurement noise": "model-error",
    "the error of": "pulses",
    "what stays unexplained": "unexplained",
    "a free curve": "free-curve",
}  # format 2 stored only the sentences

Document = dict[str, Any]


def read_document(folder: Path) -> Document:
    """Read the session.json of a folder, migrated to the current format."""
    file = folder / SESSION_FILE
    if file.stat().st_size > LARGEST_BYTES:
        raise InputError(f"larger than {LARGEST_BYTES:,} bytes, expected a session.json")
    return migrated(json.loads(file.read_text(encoding="utf-8")), folder)


def migrated(document: Any, folder: Path) -> Document:
    """The document in the current format; InputError for other content or a later format."""
    if not isinstance(document, dict):
        raise InputError("not a JSON object")
    found = document.get("format")
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        raise InputError(f'"format" is {found!r}, expected a whole number from 1 to {FORMAT}')
    if found > FORMAT:
        raise InputError(
            f"written in format {found} by flexviz {document.get('flexviz', 'of a later version')}; "
            f"this one reads up to format {FORMAT}"
        )
    while document["format"] < FORMAT:
        document = MIGRATIONS[document["format"]](document, folder)
    return document


def from_1(document: Document, folder: Path) -> Document:
    """Migrate format 1: in a copy of the set, all arrays in one file, no hashes, notes or times."""
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


def from_2(document: Document, folder: Path) -> Document:
    """Migrate format 2: other class names, notes of a diagnosis as plain sentences."""
    return renamed(document) | {"format": 3}


def renamed(value: Any) -> Any:
    """Packed values with the current names of classes and fields."""
    if isinstance(value, list):
        return [renamed(item) for item in value]
    if not isinstance(value, dict):
        return value
    new = {RENAMED_FIELDS.get(key, key): renamed(item) for key, item in value.items()}
    kind = new.get("=")
    if isinstance(kind, str):
        new["="] = RENAMED.get(kind, kind)
    if kind == "Diagnosis":
        new["notes"] = [typed_note(note) if isinstance(note, str) else note for note in new.get("notes", [])]
    return new


def typed_note(text: str) -> Document:
    """A note of a diagnosis; its kind is inferred from the beginning of the text."""
    found = (kind for start, kind in NOTE_BEGINNINGS.items() if text.startswith(start))
    bandwidth = "bandwidth" if "bandwidth" in text else "other"
    return {"=": "Note", "kind": next(found, bandwidth), "text": text}


MIGRATIONS: dict[int, Callable[[Document, Path], Document]] = {1: from_1, 2: from_2}
