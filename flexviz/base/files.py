"""Atomic writing of files and folders, leftovers of killed processes, checksums, and JSON text.

What is being written has a hidden name that ends in `PART`, and its process holds a lock on it: on a file
itself, on a file `LOCK` in a folder.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import shutil
import stat
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from flexviz.base.errors import InputError

PART = ".flexviz-part"  # suffix of files and folders while they are written
ABANDONED = 600.0  # [s] age of unlocked ones that a killed process has left
NEW, OLD = "new", "old"  # in the hidden folder: what is written, and what it replaces
LOCK = ".lock"  # in the hidden folder, and in a session's while it is saved
_looked_through: set[Path] = set()  # folders where this process has removed leftovers


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
    remove_leftovers_once(target.parent)
    descriptor, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=PART)
    try:
        with os.fdopen(descriptor, "wb") as file:
            lock(descriptor)
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


def zipped(contents: Iterable[tuple[str, str | bytes]]) -> bytes:
    """A zip archive of files, (name, content) each."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents:
            archive.writestr(name, content)
    return packed.getvalue()


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A new folder to fill, which takes the place of `folder` if no error is raised: all of it or nothing."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    remove_leftovers_once(folder.parent)
    with _hidden_folder(f".{folder.name}.", folder.parent) as temporary:
        new = temporary / NEW
        new.mkdir()
        yield new
        if folder.exists():
            os.replace(folder, temporary / OLD)
        os.replace(new, folder)
    sync_folder(folder.parent)


@contextmanager
def temporary_folder(purpose: str) -> Iterator[Path]:
    """An empty temporary folder, removed at the end; if the process is killed, by a later one."""
    parent = Path(tempfile.gettempdir())
    remove_leftovers_once(parent)
    with _hidden_folder(f"flexviz-{purpose}-", parent) as folder:
        (folder / NEW).mkdir()
        yield folder / NEW


@contextmanager
def _hidden_folder(prefix: str, parent: Path) -> Iterator[Path]:
    with (
        tempfile.TemporaryDirectory(prefix=prefix, suffix=PART, dir=parent) as folder,
        (Path(folder) / LOCK).open("wb") as file,
    ):
        lock(file.fileno())
        yield Path(folder)


def copy_tree(source: Path, target: Path, ignore: Callable[[str, list[str]], set[str]] | None = None) -> None:
    """Copy a folder; one OSError, the first, if that fails."""
    try:
        shutil.copytree(source, target, ignore=ignore, dirs_exist_ok=True)
    except shutil.Error as error:
        raise OSError(error.args[0][0][2]) from None


def sync_folder(folder: Path) -> None:
    """Flush a folder's list of names to disk, where the system can do that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def lock(descriptor: int) -> bool:
    """Try to lock an open file until it is closed; whether that worked."""
    from filelock import lock_descriptor  # 50 ms, for those who write

    try:
        return lock_descriptor(descriptor, blocking=False)
    except OSError:  # a file system without locks
        return False


def remove_leftovers(folder: Path, age: float = ABANDONED) -> None:
    """Remove what killed processes of this user have left in a folder: `age` [s] old, and locked by nobody.

    A folder that was about to be replaced is put back.
    """
    for left in folder.glob(f"*{PART}"):
        with suppress(OSError):  # gone meanwhile, or not readable
            found = left.lstat()
            own = not hasattr(os, "geteuid") or found.st_uid == os.geteuid()
            kind = stat.S_IFMT(found.st_mode)
            if own and kind in (stat.S_IFREG, stat.S_IFDIR) and time.time() - found.st_mtime >= age:
                _remove_unlocked(left)


def _remove_unlocked(left: Path) -> None:
    folder = left.is_dir()
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | (os.O_CREAT if folder else 0)
    descriptor = os.open(left / LOCK if folder else left, flags)
    try:
        if not lock(descriptor):
            return
    finally:
        os.close(descriptor)  # some systems remove no open files; nobody writes there again
    if not folder:
        left.unlink()
        return
    if (left / OLD).exists():
        replaced = left.with_name(left.name.removesuffix(PART)[1:].rpartition(".")[0])
        if not replaced.exists():
            os.replace(left / OLD, replaced)
    shutil.rmtree(left, ignore_errors=True)


def remove_leftovers_once(folder: Path) -> None:
    """The same, the first time that this process writes there."""
    if folder not in _looked_through:
        _looked_through.add(folder)
        remove_leftovers(folder)


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
