"""Where a recording is written: at its own place while there is nothing, else beside what is there."""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from flexviz.errors import InputError
from flexviz.recording.checking import check_recording, sidecar

SUFFIX = ".rrd"


@dataclass(frozen=True)
class Recorded:
    """What was written.

    Attributes
    ----------
    file: the recording.
    bytes: its size.
    chunks: how many chunks it holds, read back.
    sha256: of the file; also beside it in `<file>.sha256`.
    complete: False where it was stopped before everything was recorded.
    """

    file: Path
    bytes: int
    chunks: int
    sha256: str
    complete: bool = True


class Target:
    """A file that is being recorded.

    Attributes
    ----------
    file: where the recording belongs.
    part: where it is written. That is `file` itself where there was none, so that whoever looks for it after
        the program was killed finds it; else `<name>.unfinished.rrd` beside it, and the old one stays until
        the new one is whole.
    """

    def __init__(self, file: Path) -> None:
        """Raises InputError where nothing can be written there."""
        check_target(file)
        self.file = file
        self.part = beside(file, "unfinished") if file.exists() else file
        try:
            self.part.touch()
            sidecar(self.part).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=self.part) from None

    def finish(self, entities: set[str], complete: bool = True) -> Recorded:
        """Read the written file back, move it to its place, and put its SHA-256 beside it.

        An incomplete one stays beside an older whole one.

        Raises
        ------
        InputError: what was written cannot be read back.
        OSError: something that was logged is not in it, or it cannot be moved.
        """
        checked = check_recording(self.part)
        if missing := entities - set(checked.entities):
            raise OSError(f"{len(missing)} entities were not written, {min(missing)} among them")
        place = self.file if complete else self.part
        if place != self.part:
            sidecar(place).unlink(missing_ok=True)
            os.replace(self.part, place)
        write_sidecar(place, checked.sha256)
        return Recorded(place, place.stat().st_size, checked.chunks, checked.sha256, complete)

    def abandon(self) -> None:
        """Remove what was written."""
        self.part.unlink(missing_ok=True)


def check_target(file: Path) -> None:
    """Say before the work that `file` cannot be written."""
    if file.is_dir():
        raise InputError("is a folder; the name of a file, *.rrd, would be right", file=file)
    if not file.absolute().parent.is_dir():
        raise InputError(f"the folder {file.absolute().parent} does not exist", file=file)


def beside(file: Path, what: str) -> Path:
    """A name beside `file` that is free: demo.rrd → demo.unfinished.rrd, demo.unfinished-2.rrd, …"""
    stem = file.name.removesuffix(SUFFIX)
    for number in count(1):
        again = file.with_name(f"{stem}.{what}{'' if number == 1 else f'-{number}'}{SUFFIX}")
        if not again.exists():
            return again
    raise AssertionError


def write_sidecar(file: Path, sha256: str) -> None:
    """Put a recording's SHA-256 beside it, in the form `sha256sum --check` reads."""
    part = sidecar(file).with_name(f".{sidecar(file).name}.part")
    part.write_text(f"{sha256}  {file.name}\n", encoding="utf-8")
    os.replace(part, sidecar(file))
