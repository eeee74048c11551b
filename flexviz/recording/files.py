"""Where a recording is written: at its own place while there is nothing, else beside what is there."""

from __future__ import annotations

import glob
import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from flexviz.errors import InputError
from flexviz.files import PART, write_whole
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
    part: where it grows. That is `file` itself where there was none, so that whoever looks for it after the
        program was killed finds it; else `<name>.unfinished.rrd` beside it, and the old one stays until the
        new one is whole.
    now: where it is at present: hidden, until its beginning is written.
    """

    def __init__(self, file: Path) -> None:
        """Raises InputError where nothing can be written there."""
        check_target(file)
        self.file = file
        self.part = beside(file, "unfinished") if file.exists() else file
        self.now = hidden(self.part)
        try:
            remove_leftovers(file)
            self.now.touch()
            sidecar(self.part).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=file) from None

    def appear(self) -> None:
        """Its beginning is written: it may be found from now on. (What is open stays open.)"""
        if self.now != self.part:
            if self.part.exists():  # somebody else has taken the name meanwhile
                self.part = beside(self.file, "unfinished")
            os.replace(self.now, self.part)
            self.now = self.part

    def finish(self, entities: set[str], layout: rrb.Blueprint | None, complete: bool = True) -> Recorded:
        """Put the recording in order, read it back, move it to its place, and put its SHA-256 beside it.

        `layout` takes the place of the many that a growing recording has had. An incomplete recording stays
        beside an older whole one.

        Raises
        ------
        InputError: what was written cannot be read back.
        OSError: something that was logged is not in it, or it cannot be moved.
        """
        place = self.file if complete else self.part
        tidy = hidden(place, "tidy")
        try:
            rewrite(self.now, tidy, layout)
            checked = check_recording(tidy)
            if missing := entities - set(checked.entities):
                raise OSError(f"{len(missing)} entities were not written, {min(missing)} among them")
            sidecar(place).unlink(missing_ok=True)
            os.replace(tidy, place)
        finally:
            tidy.unlink(missing_ok=True)
        if place != self.now:
            self.now.unlink(missing_ok=True)
        write_sidecar(place, checked.sha256)
        return Recorded(place, place.stat().st_size, checked.chunks, checked.sha256, complete)

    def abandon(self) -> None:
        """Remove what was written."""
        self.now.unlink(missing_ok=True)


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


def hidden(file: Path, what: str = "new") -> Path:
    """Where this process writes what is not yet to be seen: .demo.rrd.new.1234.part"""
    return file.with_name(f".{file.name}.{what}.{os.getpid()}{PART}")


def remove_leftovers(file: Path) -> None:
    """Remove what processes that were killed have left hidden beside a recording."""
    stem = file.name.removesuffix(SUFFIX)
    for left in file.absolute().parent.glob(f".{glob.escape(stem)}*{SUFFIX}.*{PART}"):
        number = left.name.removesuffix(PART).rpartition(".")[2]
        if number.isdigit() and not _runs(int(number)):
            left.unlink(missing_ok=True)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True


def rewrite(source: Path, target: Path, layout: rrb.Blueprint | None = None) -> None:
    """Write the data of a recording anew, with one layout (None: without any) and a footer."""
    reader = RrdReader(str(source))
    (entry,) = reader.recordings()
    stream = rr.RecordingStream(entry.application_id, recording_id=entry.recording_id, send_properties=False)
    stream.save(target, default_blueprint=layout)
    stream.send_chunks(reader.stream(store=entry))
    stream.flush()
    stream.disconnect()


def write_sidecar(file: Path, sha256: str) -> None:
    """Put a recording's SHA-256 beside it, in the form `sha256sum --check` reads."""
    write_whole(sidecar(file), f"{sha256}  {file.name}\n".encode())
