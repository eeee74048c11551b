"""Atomic writing of files and folders, checksums, and JSON text."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from flexviz.errors import InputError

PART = ".part"  # suffix of a file while it is written


@contextmanager
def named_errors(file: Path | None, done: str = "written") -> Iterator[None]:
    """Errors of the system as an InputError: that this file cannot be written (read, made …), and why."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be {done} ({error.strerror or error})", file=file) from None


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: at any time the old content or the new one is there, never a part.

    The content is flushed to disk before it replaces the file. Anything but a plain file (/dev/stdout, a
    named pipe) is written to directly.
    """
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    target = path.resolve()
    descriptor, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=PART)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    sync_folder(target.parent)


def write_file(path: Path, content: str | bytes) -> None:
    """`write_whole`, with an InputError for a file that cannot be written."""
    with named_errors(path):
        write_whole(path, content.encode() if isinstance(content, str) else content)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A new folder to fill, which takes the place of `folder` if no error is raised: all of it or nothing."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as temporary:
        new = Path(temporary) / "new"
        new.mkdir()
        yield new
        if folder.exists():
            os.replace(folder, Path(temporary) / "old")
        os.replace(new, folder)
    sync_folder(folder.parent)


def sync_folder(folder: Path) -> None:
    """Flush a folder's list of names to disk, where the system can do that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def remove_parts(folder: Path, name: str = "") -> None:
    """Remove what an interrupted `write_whole` has left in a folder, of one file or of all."""
    for file in folder.glob(f".{name or '*'}.*{PART}"):
        file.unlink(missing_ok=True)


def sha256_of(file: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    with file.open("rb") as source:
        return hashlib.file_digest(source, "sha256").hexdigest()


def as_json(data: Any) -> str:
    """JSON text of numbers, texts, lists and tables; NaN and infinity become null, tuples lists."""
    return json.dumps(_finite(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
