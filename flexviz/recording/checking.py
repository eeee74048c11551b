"""Whether a recording is whole: its own SHA-256 beside it, and its chunks read back."""

from __future__ import annotations

import hashlib
import warnings
from dataclasses import dataclass
from pathlib import Path

from rerun.chunk import RrdReader

from flexviz.errors import InputError

BLOCK = 1 << 20  # [bytes]


@dataclass(frozen=True)
class Checked:
    """What a recording holds.

    Attributes
    ----------
    file: the recording.
    chunks, rows: how many.
    entities: their paths.
    sha256: of the file.
    """

    file: Path
    chunks: int
    rows: int
    entities: tuple[str, ...]
    sha256: str


def sidecar(file: Path) -> Path:
    """The file with the recording's SHA-256, in the form `sha256sum --check` reads."""
    return file.with_name(file.name + ".sha256")


def sha256_of(file: Path) -> str:
    """The file's SHA-256."""
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while block := stream.read(BLOCK):
            digest.update(block)
    return digest.hexdigest()


def check_recording(path: str | Path) -> Checked:
    """Read a recording back; InputError when it is damaged, empty, or not one.

    The viewer's own check passes empty files and garbage, so every chunk is decoded here, and the SHA-256 is
    compared where it lies beside the file.
    """
    file = Path(path)
    try:
        found = sha256_of(file)
        expected = sidecar(file).read_text().split()[0] if sidecar(file).is_file() else found
    except (OSError, IndexError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "its .sha256 file cannot be read"
        raise InputError(f"cannot be read ({reason})", file=file) from None
    if found != expected:
        raise InputError("is damaged: its SHA-256 is not the one written beside it", file=file)
    chunks = rows = 0
    entities: dict[str, None] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a file without its end is only a warning for the reader
            for chunk in RrdReader(str(file)).stream():
                rows += chunk.to_record_batch().num_rows
                chunks += 1
                entities[chunk.entity_path] = None
    except Exception as error:  # whatever a damaged file makes the decoder raise
        raise InputError(f"is not a readable Rerun recording ({error})", file=file) from None
    if chunks == 0:
        raise InputError("is empty: a Rerun recording with data would be right", file=file)
    return Checked(file, chunks, rows, tuple(entities), found)
