"""Files from a browser: their names, kinds and sizes, checked before anything is written.

Names are only names: what is written lies in a new folder of our own, whatever the file calls itself.
No viser here.
"""

from __future__ import annotations

import io
import re
import shutil
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from flexviz.errors import InputError
from flexviz.session import SESSION_FILE

LARGEST_UPLOAD = 512 * 2**20  # bytes of one file from a browser
LARGEST_SET = 2 * 2**30  # bytes of all files of a set, unpacked
MOST_FILES = 500
KINDS = (
    ".toml", ".csv", ".parquet", ".urdf", ".xml", ".json", ".npz", ".stl", ".dae", ".obj", ".mtl", ".ply",
    ".glb", ".gltf", ".png", ".jpg", ".md", ".txt",
)  # fmt: skip
_NAME = re.compile(r"[^\w.+ -]", re.UNICODE)
MAIN = "measurements.toml"


def safe_name(name: str) -> str:
    """The last part of a file's name, with nothing in it that a path could be made of."""
    last = re.split(r"[\\/]", name)[-1].strip()
    cleaned = _NAME.sub("_", last)[:120]
    if not cleaned.strip("._ ") or cleaned.startswith("."):
        raise InputError(f"{name[:60]!r} is not a file name")
    if Path(cleaned).suffix.lower() not in (*KINDS, ".zip"):
        raise InputError(f"{cleaned}: {', '.join((*KINDS, '.zip'))} can be uploaded")
    return cleaned


def new_folder(parent: Path, name: str) -> Path:
    """A folder in `parent` that does not exist yet, called like `name`; not made."""
    stem = _NAME.sub("_", name).strip("._ ")[:60] or "uploaded"
    number = 1
    folder = parent / stem
    while folder.exists():
        number += 1
        folder = parent / f"{stem}-{number}"
    return folder


def inside(archive: zipfile.ZipFile) -> list[tuple[zipfile.ZipInfo, PurePosixPath]]:
    """The files of a zip with the place each gets; InputError for anything that is not a plain set.

    One folder around everything is left out.
    """
    entries: list[tuple[zipfile.ZipInfo, PurePosixPath]] = []
    total = 0
    for info in archive.infolist():
        if info.is_dir():
            continue
        path = PurePosixPath(info.filename.replace("\\", "/"))
        kind = info.external_attr >> 28
        if path.is_absolute() or ".." in path.parts or ":" in info.filename or "\0" in info.filename:
            raise InputError(f"{info.filename[:80]!r} leads out of the folder")
        if kind not in (0, 0o10):  # anything but a plain file: links, devices
            raise InputError(f"{info.filename[:80]!r} is not a plain file")
        if any(part.startswith((".", "__MACOSX")) for part in path.parts):
            continue
        if path.suffix.lower() not in KINDS:
            raise InputError(f"{info.filename[:80]!r}: {', '.join(KINDS)} can be uploaded")
        total += info.file_size
        entries.append((info, path))
    if len(entries) > MOST_FILES:
        raise InputError(f"{len(entries)} files; at most {MOST_FILES} are accepted")
    if total > LARGEST_SET:
        raise InputError(
            f"{total / 2**20:.0f} MB unpacked; at most {LARGEST_SET / 2**20:.0f} MB are accepted"
        )
    tops = {path.parts[0] for _, path in entries}
    if len(tops) == 1 and all(len(path.parts) > 1 for _, path in entries):
        entries = [(info, PurePosixPath(*path.parts[1:])) for info, path in entries]
    if len({str(path).lower() for _, path in entries}) < len(entries):
        raise InputError("two files have the same name")
    names = [str(path) for _, path in entries]
    if MAIN not in names and SESSION_FILE not in names and sum(n.endswith(".urdf") for n in names) != 1:
        raise InputError(f"there is neither {MAIN} nor {SESSION_FILE} in it, nor one robot's URDF")
    return entries


def unpack(name: str, content: bytes, parent: Path) -> Path:
    """Write a zip's set into a new folder in `parent`; returns the folder. Nothing stays where it fails."""
    folder = new_folder(parent, Path(safe_name(name)).stem)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = inside(archive)
            folder.mkdir(parents=True)
            for info, path in entries:
                target = folder / path
                target.parent.mkdir(parents=True, exist_ok=True)
                _copy(archive, info, target)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f"{safe_name(name)} is not a usable zip ({error})") from None
    except (OSError, InputError):
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def _copy(archive: zipfile.ZipFile, info: zipfile.ZipInfo, target: Path) -> None:
    """Write one file, but not more than the zip says it has."""
    left = info.file_size
    with archive.open(info) as source, target.open("xb") as sink:
        while chunk := source.read(min(2**20, left + 1)):
            left -= len(chunk)
            if left < 0:
                raise InputError(f"{info.filename[:80]!r} is larger than it says")
            sink.write(chunk)
