"""Recording files: temporary names while they grow, completion."""

from __future__ import annotations

import os
from dataclasses import replace
from itertools import count
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from flexviz.base.errors import InputError
from flexviz.base.files import PART, named_errors, remove_leftovers_once, write_whole
from flexviz.outlets.recording.file_sink import FileSink
from flexviz.outlets.recording.reading import Recorded, check_recording, sidecar

SUFFIX = ".rrd"


class Target:
    """A file that is being recorded.

    Attributes:
        file: the path of the finished recording.
        part: the path of the growing recording: `file` itself, so that it is found after a crash, or
            `<name>.unfinished.rrd` if `file` exists, which is kept until the new one is complete.
        now: the current path; hidden until the first data are written.
    """

    def __init__(self, file: Path) -> None:
        """Raises InputError if nothing can be written there."""
        check_target(file)
        self.file = file
        self.part = beside(file, "unfinished") if file.exists() else file
        self.now = hidden(self.part)
        with named_errors(file):
            remove_leftovers_once(file.absolute().parent)
            self.now.touch()
            sidecar(self.part).unlink(missing_ok=True)

    def appear(self) -> None:
        """Make the file visible; it stays open."""
        if self.now != self.part:
            if self.part.exists():  # created by another program in the meantime
                self.part = beside(self.file, "unfinished")
            os.replace(self.now, self.part)
            self.now = self.part

    def finish(self, entities: set[str], layout: rrb.Blueprint | None, complete: bool = True) -> Recorded:
        """Rewrite the recording in order, read it back, move it into place and write its SHA-256 file.

        `layout` replaces all layouts of the growing recording. An incomplete recording does not replace an
        older file.

        Raises:
            InputError: the recording cannot be written or read back, or entities are missing.
        """
        place = self.file if complete else self.part
        tidy = hidden(place, "tidy")
        with named_errors(self.file, "completed, but what was recorded is kept"):
            try:
                rewrite(self.now, tidy, layout)
                checked = check_recording(tidy, own=True)
                if missing := entities - set(checked.entities):
                    raise OSError(f"{len(missing)} entities were not written, {min(missing)} among them")
                sidecar(place).unlink(missing_ok=True)
                os.replace(tidy, place)
            finally:
                tidy.unlink(missing_ok=True)
            if place != self.now:
                self.now.unlink(missing_ok=True)
            write_sidecar(place, checked.sha256)
        return replace(checked, file=place, confirmed=True, complete=complete)


def check_target(file: Path) -> None:
    """Raise InputError if `file` cannot be written."""
    if file.is_dir():
        raise InputError("is a folder, expected a file name *.rrd", file=file)
    if not file.absolute().parent.is_dir():
        raise InputError(f"the folder {file.absolute().parent} does not exist", file=file)


def beside(file: Path, what: str) -> Path:
    """A free name beside `file`: demo.rrd → demo.unfinished.rrd, demo.unfinished-2.rrd, …"""
    stem = file.name.removesuffix(SUFFIX)
    for number in count(1):
        again = file.with_name(f"{stem}.{what}{'' if number == 1 else f'-{number}'}{SUFFIX}")
        if not again.exists():
            return again
    raise AssertionError


def hidden(file: Path, what: str = "new") -> Path:
    """The hidden file of this process: .demo.rrd.new.1234.flexviz-part"""
    return file.with_name(f".{file.name}.{what}.{os.getpid()}{PART}")


def rewrite(source: Path, target: Path, layout: rrb.Blueprint | None = None) -> None:
    """Rewrite the data of a recording with one layout (or none) and a footer."""
    reader = RrdReader(str(source))
    (entry,) = reader.recordings()
    stream = rr.RecordingStream(entry.application_id, recording_id=entry.recording_id, send_properties=False)
    sink = FileSink(stream, target, layout)
    stream.send_chunks(reader.stream(store=entry))
    sink.close()


def write_sidecar(file: Path, sha256: str) -> None:
    """Write a recording's SHA-256 file in the format of `sha256sum --check`."""
    write_whole(sidecar(file), f"{sha256}  {file.name}\n".encode())
