"""Recording files: written at their own place or beside an older file, finished, repaired."""

from __future__ import annotations

import glob
import os
import subprocess
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from flexviz.errors import InputError
from flexviz.files import PART, write_whole
from flexviz.recording.checking import Checked, check_recording, sidecar
from flexviz.recording.viewers import rerun_program

SUFFIX = ".rrd"
NOTHING_TO_SAVE = "holds nothing that could be saved: the program was killed before anything was written"
SMALLEST_RECORDING = 1000  # bytes


@dataclass(frozen=True)
class Recorded:
    """What was written.

    Attributes:
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

    Attributes:
        file: where the finished recording belongs.
        part: where it grows: `file` if there was none, so that it is found after the program was killed; else
            `<name>.unfinished.rrd` beside the old file, which stays until the new one is whole.
        now: where it is at present: hidden until its beginning is written.
    """

    def __init__(self, file: Path) -> None:
        """Raises InputError if nothing can be written there."""
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
        """Make it visible, its beginning is written. The open file stays open."""
        if self.now != self.part:
            if self.part.exists():  # another program has taken the name meanwhile
                self.part = beside(self.file, "unfinished")
            os.replace(self.now, self.part)
            self.now = self.part

    def finish(self, entities: set[str], layout: rrb.Blueprint | None, complete: bool = True) -> Recorded:
        """Rewrite the recording in order, read it back, move it to its place, write its SHA-256 beside it.

        `layout` replaces the many layouts of a growing recording. An incomplete recording stays
        beside an older whole one.

        Raises:
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
    """InputError if `file` cannot be written."""
    if file.is_dir():
        raise InputError("is a folder, expected a file name *.rrd", file=file)
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
    """The hidden file of this process: .demo.rrd.new.1234.part"""
    return file.with_name(f".{file.name}.{what}.{os.getpid()}{PART}")


def remove_leftovers(file: Path) -> None:
    """Remove the hidden files of killed processes beside a recording."""
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
    """Rewrite the data of a recording with one layout (None: without any) and a footer."""
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


def repair_recording(path: str | Path) -> Checked:
    """Write the readable part of a truncated recording beside it, as `<name>.repaired.rrd`, with a footer.

    The file itself does not change.

    Raises:
        InputError: there is nothing to save, or the file is damaged in the middle.
    """
    file = Path(path)
    target = beside(file, "repaired")
    part = hidden(target)
    try:
        # Rerun's own tool rewrites every whole message, with a footer
        run = subprocess.run(
            [str(rerun_program()), "rrd", "optimize", str(file), "-o", str(part)],
            capture_output=True,
            text=True,
        )
        if run.returncode != 0 or not part.is_file():
            empty = file.stat().st_size < SMALLEST_RECORDING
            raise InputError(NOTHING_TO_SAVE if empty else "is damaged, and cannot be repaired", file=file)
        try:
            checked = check_recording(part)
        except InputError:
            raise InputError(NOTHING_TO_SAVE, file=file) from None
        os.replace(part, target)
    except OSError as error:
        raise InputError(f"cannot be repaired ({error.strerror or error})", file=file) from None
    finally:
        part.unlink(missing_ok=True)
    write_sidecar(target, checked.sha256)
    return check_recording(target)
