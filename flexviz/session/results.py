"""The numbers of a session's results: one file each, named by its content, written once."""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.errors import InputError
from flexviz.files import remove_parts, write_whole

FOLDER = "results"
LARGEST = 2 * 2**30  # bytes of all arrays of one result, unpacked
_NAME = re.compile(rf"{FOLDER}/([0-9a-f]{{32}})\.npz")


def digest(arrays: Sequence[np.ndarray]) -> str:
    """A name for these arrays that no others have."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype.str}{array.shape};".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()[:32]


def write(folder: Path, arrays: Sequence[np.ndarray]) -> dict[str, Any]:
    """Keep arrays in a session's folder, where they are not there yet; returns where they are."""
    for array in arrays:
        if array.dtype.hasobject:
            raise InputError("an array of objects cannot be kept in a session")
    name = f"{FOLDER}/{digest(arrays)}.npz"
    if not (folder / name).is_file():
        (folder / FOLDER).mkdir(exist_ok=True)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **{f"a{i}": array for i, array in enumerate(arrays)})  # type: ignore[arg-type]
        write_whole(folder / name, buffer.getvalue())
    return {"file": name, "count": len(arrays)}


def read(folder: Path, entry: Any) -> list[np.ndarray]:
    """The arrays of an entry that `write` gave; InputError where they are damaged, OSError where gone."""
    name, count = entry.get("file"), entry.get("count")
    found = _NAME.fullmatch(name) if isinstance(name, str) else None
    if found is None or not isinstance(count, int):
        raise InputError("an entry of its list of arrays is something else")
    arrays = read_npz(folder / name, count)
    if digest(arrays) != found[1]:
        raise InputError("its content has changed", file=folder / name)
    return arrays


def read_npz(file: Path, count: int | None = None) -> list[np.ndarray]:
    """The arrays a0, a1, … of a file; `count` of them where that is known."""
    try:
        with zipfile.ZipFile(file) as archive:
            if sum(info.file_size for info in archive.infolist()) > LARGEST:
                raise InputError("larger than any result", file=file)
        with np.load(file, allow_pickle=False) as npz:
            if count is not None and len(npz.files) != count:
                raise InputError(f"has {len(npz.files)} arrays, {count} would be right", file=file)
            return [npz[f"a{i}"] for i in range(len(npz.files))]
    except (zipfile.BadZipFile, ValueError, KeyError, EOFError, NotImplementedError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"is damaged ({type(error).__name__}: {error})", file=file) from None


def remove_others(folder: Path, keep: Sequence[dict[str, Any]]) -> None:
    """Remove the results that no state of the session has any more, and what an interrupted save has left."""
    names = {entry["file"] for entry in keep}
    for file in (folder / FOLDER).glob("*.npz"):
        if f"{FOLDER}/{file.name}" not in names:
            file.unlink(missing_ok=True)
    if (folder / FOLDER).is_dir():
        remove_parts(folder / FOLDER)
