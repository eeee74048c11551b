"""Autosave: unsaved work is written in the background and can be recovered after a crash.

    <root>/<name>-<hash of the set's path>/<time>-<process>/        a session folder, set by reference
    <root>/<name>-<hash of the set's path>/<time>-<process>.lock    locked while that process lives

Only folders that no live process has locked are offered for recovery.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from flexviz.base.errors import FlexvizError, one_line
from flexviz.base.files import lock, remove_leftovers
from flexviz.content.session.document import SESSION_FILE
from flexviz.content.session.saving import save_session
from flexviz.content.session.state import Session
from flexviz.data.measurements import MeasurementSet

LOCK = ".lock"
MAX_RECOVERABLE = 5  # abandoned sessions kept per set


@dataclass(frozen=True)
class Unsaved:
    """An abandoned session that was never saved."""

    folder: Path  # for `open_session`
    when: datetime  # of its last change


class Autosave:
    """Writes the latest state of the open session from a background thread.

    `root` returns the folder for all autosaved sessions, or raises InputError. `failed` is called from the
    thread with a one-line error message.
    """

    def __init__(self, root: Callable[[], Path], failed: Callable[[str], None] = lambda text: None) -> None:
        self._root, self._failed = root, failed
        self._change = threading.Condition()
        self._waiting: tuple[Session, MeasurementSet] | None = None
        self._due = 0.0
        self._busy = self._closed = False
        self._folder: Path | None = None
        self._lock: int | None = None
        self._inherited: list[Path] = []
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Start over for another session; what was autosaved so far stays on disk."""
        self.flush()
        with self._change:
            self._release()

    def keep(self, session: Session, measurements: MeasurementSet, delay: float = 0.0) -> None:
        """Schedule this state to be written within `delay` [s]; only the latest one is written."""
        with self._change:
            if self._closed:
                return
            due = time.monotonic() + delay
            self._due = due if self._waiting is None else min(due, self._due)
            self._waiting = session, measurements
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="autosave", daemon=True)
                self._thread.start()
            self._change.notify_all()

    def inherit(self, unsaved: Unsaved, session: Session, measurements: MeasurementSet) -> None:
        """Continue a recovered session; its old folder is removed once it is written again or saved."""
        with self._change:
            self._inherited.append(unsaved.folder)
        self.keep(session, measurements)

    def flush(self, timeout: float = 60.0) -> bool:
        """Write the pending state; False if that took longer than `timeout` [s]."""
        with self._change:
            self._due = 0.0
            self._change.notify_all()
            return self._change.wait_for(lambda: self._waiting is None and not self._busy, timeout)

    def saved(self) -> None:
        """Remove the autosaved state after the user has saved."""
        with self._change:
            self._waiting = None
            self._change.wait_for(lambda: not self._busy)
            folders = [*self._inherited, *([self._folder] if self._folder else [])]
            self._release()
        for folder in folders:
            _remove(folder)

    def close(self) -> None:
        """Write the pending state and stop the thread."""
        self.flush()
        with self._change:
            self._closed = True
            self._release()
            self._change.notify_all()

    # -- the thread ----------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._change:
                while not self._closed and (self._waiting is None or time.monotonic() < self._due):
                    left = None if self._waiting is None else max(self._due - time.monotonic(), 0.0)
                    self._change.wait(left)
                if self._waiting is None:
                    return
                (session, measurements), self._waiting, self._busy = self._waiting, None, True
            try:
                self._write(session, measurements)
            except Exception as error:  # the next state may still be writable
                kind = "" if isinstance(error, FlexvizError | OSError) else f"{type(error).__name__}: "
                self._failed(one_line(f"unsaved work cannot be kept: {kind}{error}"))
            finally:
                with self._change:
                    self._busy = False
                    self._change.notify_all()

    def _write(self, session: Session, measurements: MeasurementSet) -> None:
        if self._folder is None:
            self._folder = self._new_folder(measurements.path)
        save_session(session, measurements, self._folder)
        for folder in self._inherited:
            _remove(folder)
        self._inherited = []

    def _new_folder(self, of: Path) -> Path:
        place = _place(self._root(), of)
        place.mkdir(parents=True, exist_ok=True)
        for old in _left_behind(place)[MAX_RECOVERABLE - 1 :]:
            if old not in self._inherited:
                _remove(old)
        _remove_interrupted(place)
        folder = place / f"{datetime.now(UTC):%Y%m%d-%H%M%S}-{os.getpid()}"
        while folder.exists() or _lock_of(folder).exists():
            folder = folder.with_name(folder.name + "a")
        self._lock = os.open(_lock_of(folder), os.O_RDWR | os.O_CREAT, 0o666)
        lock(self._lock)
        return folder

    def _release(self) -> None:
        """Let go of the folders written so far."""
        if self._lock is not None:
            os.close(self._lock)
        self._lock, self._folder, self._inherited = None, None, []


def find_unsaved(root: Path, of: Path, session: Path | None = None) -> Unsaved | None:
    """The latest abandoned unsaved work on the measurement set in the folder `of`, if any.

    Sessions of live processes are ignored, and so is work older than the session saved in `session`.
    """
    found = _left_behind(_place(root, of))
    if not found:
        return None
    when = (found[0] / SESSION_FILE).stat().st_mtime
    saved = None if session is None else session / SESSION_FILE
    if saved is not None and saved.is_file() and saved.stat().st_mtime >= when:
        return None
    return Unsaved(found[0], datetime.fromtimestamp(when, UTC))


def _place(root: Path, of: Path) -> Path:
    of = of.resolve()
    return root / f"{of.name[:40]}-{hashlib.sha256(str(of).encode()).hexdigest()[:12]}"


def _lock_of(folder: Path) -> Path:
    return folder.with_name(folder.name + LOCK)


def _left_behind(place: Path) -> list[Path]:
    """Sessions whose process has ended, latest first."""
    rows = []
    for file in place.glob(f"*/{SESSION_FILE}"):
        try:
            if not _in_use(file.parent):
                rows.append((file.stat().st_mtime_ns, file.parent))
        except OSError:
            continue  # removed meanwhile
    return [folder for _, folder in sorted(rows, reverse=True)]


def _in_use(folder: Path) -> bool:
    try:
        descriptor = os.open(_lock_of(folder), os.O_RDWR)
    except FileNotFoundError:
        return False
    try:
        return not lock(descriptor)
    finally:
        os.close(descriptor)


def _remove(folder: Path) -> None:
    """Remove a session folder, session.json first, and its parent folders if empty."""
    (folder / SESSION_FILE).unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
    _lock_of(folder).unlink(missing_ok=True)
    for above in list(folder.parents)[:2]:
        try:
            above.rmdir()
        except OSError:
            break


def _remove_interrupted(place: Path) -> None:
    """Remove incomplete folders and unused locks of processes that have ended."""
    remove_leftovers(place, age=0.0)
    for file in place.glob(f"*{LOCK}"):
        folder = place / file.name.removesuffix(LOCK)
        if not folder.exists() and not _in_use(folder):
            file.unlink(missing_ok=True)
