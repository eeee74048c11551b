"""Integrity of a recording: footer, number of chunks, SHA-256."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rerun.chunk import RrdReader

from flexviz.errors import InputError
from flexviz.files import sha256_of

TRUNCATED = ("no footer", "exceeds file size")  # in the reader's message on a truncated file


@dataclass(frozen=True)
class Checked:
    """A checked recording.

    Attributes:
        chunks, rows: their numbers.
        entities: entity paths.
        sha256: of the file.
        confirmed: whether it agrees with the .sha256 file.
    """

    file: Path
    chunks: int
    rows: int
    entities: tuple[str, ...]
    sha256: str
    confirmed: bool = False


class TruncatedRecording(InputError):
    """A recording without its end: the program that wrote it was killed, or the file was cut."""


def sidecar(file: Path) -> Path:
    """The recording's SHA-256 file, in the format of `sha256sum --check`."""
    return file.with_name(file.name + ".sha256")


def check_recording(path: str | Path) -> Checked:
    """Read a recording back.

    The viewer's own check accepts empty files and garbage, so every chunk is decoded here and counted against
    the footer, and the SHA-256 is compared with the .sha256 file if it exists.

    Raises:
        TruncatedRecording: the end is missing; `repair_recording` saves the rest.
        InputError: damaged, empty, or not a recording.
    """
    file = Path(path)
    try:
        found = sha256_of(file)
        beside = sidecar(file).is_file()
        expected = sidecar(file).read_text().split()[0] if beside else found
    except (OSError, IndexError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "its .sha256 file cannot be read"
        raise InputError(f"cannot be read ({reason})", file=file) from None
    with _read_errors(file):
        chunks, rows, entities = _content(file)
        promised = _promised(file)
    if found != expected:
        raise InputError("is damaged: its SHA-256 differs from its .sha256 file", file=file)
    if chunks == 0:
        raise InputError("is empty, expected a Rerun recording with data", file=file)
    if chunks != promised:
        raise InputError(f"is damaged: its footer lists {promised} chunks, found {chunks}", file=file)
    return Checked(file, chunks, rows, entities, found, beside)


@contextmanager
def _read_errors(file: Path) -> Iterator[None]:
    """Turn the reader's errors and warnings on a damaged file into one InputError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # the reader only warns about a truncated file
            yield
    except Exception as error:
        text = " ".join(str(error).split())
        if any(words in text for words in TRUNCATED):
            raise TruncatedRecording(
                "is truncated: the program that wrote it was killed, or the file was cut", file=file
            ) from None
        raise InputError(f"is not a readable Rerun recording ({text})", file=file) from None


def _content(file: Path) -> tuple[int, int, tuple[str, ...]]:
    chunks = rows = 0
    entities: dict[str, None] = {}
    for chunk in RrdReader(str(file)).stream():
        rows += chunk.to_record_batch().num_rows
        chunks += 1
        entities[chunk.entity_path] = None
    return chunks, rows, tuple(entities)


def _promised(file: Path) -> int:
    """How many chunks the footer lists."""
    return len(RrdReader(str(file)).store().summary().splitlines())
