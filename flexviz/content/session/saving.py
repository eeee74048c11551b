"""Saving a session to a folder: session.json, result arrays, and its set by reference and hash.

    session.json            settings, history, results, notes; where the set is and its SHA-256
    results/<content>.npz   the arrays of one result
    measurements.toml …     only if the session carries its set

Result files are named by content and written first; session.json is replaced atomically afterwards. So an
interrupted save leaves either the old session or the new one.
"""

from __future__ import annotations

import io
import json
import os
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from flexviz import __version__
from flexviz.base.errors import InputError
from flexviz.base.files import (
    LOCK,
    copy_tree,
    named_errors,
    remove_leftovers,
    sha256_of,
    whole_folder,
    write_whole,
)
from flexviz.content.session.document import FORMAT, OLD_ARRAYS, SESSION_FILE, SetReference, read_reference
from flexviz.content.session.packing import FOLDER, Packer, named_numbers, remove_others, write_arrays
from flexviz.content.session.state import Session, now
from flexviz.data.measurements import FILE_NAME, MeasurementSet, read_set, same_recording, write_set
from flexviz.model.effects import loaded_files

LEFT_OUT = shutil.ignore_patterns(
    ".*", "*.rrd", "*.rrd.sha256", SESSION_FILE, OLD_ARRAYS, FOLDER, "__pycache__"
)
Stamp = tuple[int, int, int]  # inode, time of change [ns], size [bytes]: every save makes a new file
_known: dict[Path, Stamp] = {}  # session folder -> its session.json when last read or written here


class SessionChanged(InputError):
    """Another program has saved to the folder since this one read it or saved there."""


def save_session(
    session: Session, measurements: MeasurementSet, folder: Path, *, carry: bool = False
) -> Path:
    """Save a session to `folder` and return the folder.

    It must be new or empty, or a session folder of the same set, which is overwritten: but not what another
    program has saved there meanwhile (`SessionChanged`). With `carry` the measurement set is copied into a
    new folder instead of being referred to; a set in memory is always written there.
    """
    own = measurements.in_files and folder.resolve() == measurements.path.resolve()
    renewed = (folder / SESSION_FILE).is_file() or own
    if not renewed and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError("exists and is not empty, expected a new folder", file=folder)
    with named_errors(folder, "saved"):
        if renewed:
            _same_set(folder, measurements)
            with locked(folder):
                _require_known(folder)
                _write(session, measurements, folder, folder)
                remember(folder, stamp_of(folder))
            return folder
        with whole_folder(folder) as new:
            if not measurements.in_files:
                write_set(new, measurements)
            elif carry:
                copy_tree(measurements.path, new, LEFT_OUT)
            _write(session, measurements, new, folder)
    remember(folder, stamp_of(folder))
    return folder


def stamp_of(folder: Path) -> Stamp:
    """What identifies the present session.json of a folder."""
    found = (folder / SESSION_FILE).stat()
    return found.st_ino, found.st_mtime_ns, found.st_size


def remember(folder: Path, stamp: Stamp) -> None:
    """Take this session.json of a folder as the one that this program may overwrite."""
    _known[folder.resolve()] = stamp


def _require_known(folder: Path) -> None:
    known = _known.get(folder.resolve())
    if known is not None and (folder / SESSION_FILE).is_file() and stamp_of(folder) != known:
        message = "was saved by another program meanwhile, expected another folder"
        raise SessionChanged(message, file=folder / SESSION_FILE)


def _same_set(folder: Path, measurements: MeasurementSet) -> None:
    """InputError if a folder holds a session of another set."""
    if not (folder / SESSION_FILE).is_file():
        return
    try:
        reference = read_reference(folder)
        place = reference.locate(folder)
    except InputError:
        return  # an unreadable session may be overwritten
    if not measurements.in_files:
        if not same_recording(read_set(place, logged=False), measurements):
            raise InputError("holds a session of other data, expected a new folder", file=folder)
        return
    if place.resolve() != measurements.path.resolve() and reference.name != measurements.name:
        raise InputError(f'holds a session of another measurement set, "{reference.name}"', file=folder)


def _write(session: Session, measurements: MeasurementSet, folder: Path, final: Path) -> None:
    """Write to `folder`, which will be renamed to `final`."""
    carried = (folder / FILE_NAME).is_file()
    referred = measurements
    if not measurements.in_files:  # its files are those that were written
        place = folder if carried else read_reference(folder).locate(folder)
        referred = replace(read_set(place, logged=False), name=measurements.name)
    packer = Packer(measurements.path)
    content = packer.pack(session)
    arrays = [write_arrays(folder, part) for part in packer.parts()]
    files = [file for file in loaded_files() if file.is_file()]
    own_effects = [{"path": str(file), "sha256": sha256_of(file)} for file in files]
    document = {
        "format": FORMAT,
        "flexviz": __version__,
        "saved": now(),
        "set": SetReference.of(referred, final, carried).to_json(),
        "effects_from": own_effects,  # opening a session never loads them
        **content,
        "recordings": [_beside(file, final) for file in session.recordings],
        "shared": packer.shared,
        "arrays": arrays,
    }
    write_whole(folder / SESSION_FILE, json.dumps(named_numbers(document), allow_nan=False).encode())
    remove_others(folder, arrays)
    remove_leftovers(folder, age=0.0)
    (folder / OLD_ARRAYS).unlink(missing_ok=True)


def _beside(file: Path, folder: Path) -> str:
    """Path of a file, relative if it is in the session folder or beside it."""
    path = file.resolve()
    if path.is_relative_to(folder.resolve().parent):
        return Path(os.path.relpath(path, folder.resolve())).as_posix()
    return str(path)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Exclusive lock on a session folder: on a hidden file in it, which some systems keep."""
    from filelock import FileLock

    with FileLock(folder / LOCK):
        yield


def zipped(folder: Path) -> bytes:
    """A session or measurement set folder as a zip file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for file in sorted(folder.rglob("*")):
            inside = file.relative_to(folder)
            if file.is_file() and not any(part.startswith(".") for part in inside.parts):
                archive.write(file, f"{folder.name}/{inside.as_posix()}")
    return buffer.getvalue()
