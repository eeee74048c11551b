"""Zipped logs: `runs.zip` with one log or several (`runs.zip/run1.csv`), and single `run.csv.gz`."""

from __future__ import annotations

import gzip
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.base.files import temporary_folder
from flexviz.base.limits import LARGEST_UNPACKED
from flexviz.data.measurements import readable

ZIP, GZIP = ".zip", ".gz"


def inside_of(path: Path) -> tuple[Path, str] | None:
    """The archive of a path `archive.zip/member`, and the member ("": none is named); None outside one."""
    for place in (path, *path.parents):
        if place.suffix.lower() in (ZIP, GZIP) and place.is_file():
            return place, path.relative_to(place).as_posix() if place != path else ""
    return None


def members(archive: Path) -> list[str]:
    """The files in an archive, without hidden ones."""
    if archive.suffix.lower() == GZIP:
        return [archive.stem]
    with readable(archive, "zip archive"), zipfile.ZipFile(archive) as packed:
        names = [info.filename for info in packed.infolist() if not info.is_dir()]
    return sorted(n for n in names if not any(part.startswith((".", "__MACOSX")) for part in Path(n).parts))


@contextmanager
def unpacked(archive: Path, member: str) -> Iterator[Path]:
    """A copy of one member, with its own name, while it is read."""
    with temporary_folder("unpacked") as folder:
        target = folder / Path(member).name
        with readable(archive, "archive"), target.open("wb") as sink:
            if archive.suffix.lower() == GZIP:
                with gzip.open(archive) as stream:
                    for _ in range(LARGEST_UNPACKED >> 20):
                        if not (block := stream.read(1 << 20)):
                            break
                        sink.write(block)
                    else:
                        raise _too_large(archive)
            else:
                with zipfile.ZipFile(archive) as packed:
                    if packed.getinfo(member).file_size > LARGEST_UNPACKED:
                        raise _too_large(archive)
                    with packed.open(member) as stream:
                        shutil.copyfileobj(stream, sink, 1 << 20)
        yield target


def _too_large(archive: Path) -> InputError:
    return InputError(f"over {LARGEST_UNPACKED:,} bytes unpacked, expected less", file=archive)
