"""Arrays of the results of a session: one content-addressed file per result, written once."""

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
LARGEST_BYTES = 2 * 2**30  # of all arrays of one result, uncompressed
_NAME = re.compile(rf"{FOLDER}/([0-9a-f]{{32}})\.npz")


def digest(arrays: Sequence[np.ndarray]) -> str:
    """Hash of types, shapes and contents of the arrays, 32 hexadecimal digits."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype.str}{array.shape};".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()[:32]


def write(folder: Path, arrays: Sequence[np.ndarray]) -> dict[str, Any]:
    """Write arrays to a session folder unless they are there already; returns their entry."""
    for array in arrays:
        if array.dtype.hasobject:
            raise InputError("an array of objects cannot be saved in a session")
    name = f"{FOLDER}/{digest(arrays)}.npz"
    if not (folder / name).is_file():
        (folder / FOLDER).mkdir(exist_ok=True)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **{f"a{i}": array for i, array in enumerate(arrays)})  # type: ignore[arg-type]
        write_whole(folder / name, buffer.getvalue())
    return {"file": name, "count": len(arrays)}


def read(folder: Path, entry: Any) -> list[np.ndarray]:
    """The arrays of an entry made by `write`; InputError if damaged, OSError if missing."""
    name, count = entry.get("file"), entry.get("count")
    found = _NAME.fullmatch(name) if isinstance(name, str) else None
    if found is None or not isinstance(count, int):
        raise InputError("an entry in its list of arrays is not in the expected form")
    arrays = read_npz(folder / name, count)
    if digest(arrays) != found[1]:
        raise InputError("its content does not match its name", file=folder / name)
    return arrays


def read_npz(file: Path, count: int | None = None) -> list[np.ndarray]:
    """The arrays a0, a1, … of a file; `count`: expected number of arrays, if known."""
    try:
        with zipfile.ZipFile(file) as archive:
            if sum(info.file_size for info in archive.infolist()) > LARGEST_BYTES:
                raise InputError(
                    f"larger than {LARGEST_BYTES:,} bytes, expected arrays of one result", file=file
                )
        with np.load(file, allow_pickle=False) as npz:
            if count is not None and len(npz.files) != count:
                raise InputError(f"has {len(npz.files)} arrays, expected {count}", file=file)
            return [npz[f"a{i}"] for i in range(len(npz.files))]
    except (zipfile.BadZipFile, ValueError, KeyError, EOFError, NotImplementedError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"is damaged ({type(error).__name__}: {error})", file=file) from None


def remove_others(folder: Path, keep: Sequence[dict[str, Any]]) -> None:
    """Remove the files of results that are no longer used, and leftovers of interrupted saves."""
    names = {entry["file"] for entry in keep}
    for file in (folder / FOLDER).glob("*.npz"):
        if f"{FOLDER}/{file.name}" not in names:
            file.unlink(missing_ok=True)
    if (folder / FOLDER).is_dir():
        remove_parts(folder / FOLDER)
