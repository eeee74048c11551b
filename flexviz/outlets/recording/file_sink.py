"""Writes a recording to a file.

Rerun's own writer never returns from `disconnect` after a failed write, e.g. on a full disk. So Rerun writes
to a pipe, and a thread copies it to the file.
"""

from __future__ import annotations

import os
import select
import threading
import time
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from flexviz.base.files import lock

DISK_TIMEOUT = 30.0  # [s]
PIECE = 2**20  # bytes


class FileSink:
    """The file of an open recording; raises OSError as soon as it cannot be written."""

    def __init__(self, stream: rr.RecordingStream, file: Path, layout: rrb.Blueprint | None = None) -> None:
        self._stream = stream
        self._error: OSError | None = None
        self._busy = threading.Lock()  # from reading the pipe until that is in the file
        self._file = file.open("wb", buffering=0)
        lock(self._file.fileno())
        self._pipe, end = os.pipe()
        self._thread = threading.Thread(target=self._copy, name="flexviz-recording-file", daemon=True)
        self._thread.start()
        stream.save(f"/dev/fd/{end}", default_blueprint=layout)
        os.close(end)  # the stream has its own

    def flush(self) -> None:
        """Write everything logged so far."""
        try:
            self._stream.flush(timeout_sec=DISK_TIMEOUT)
        except (RuntimeError, ValueError) as error:
            raise OSError(str(error)) from None
        while self._waiting():
            time.sleep(0.001)
        self._check()

    def close(self) -> None:
        """Write the rest and the footer."""
        self._stream.disconnect()
        self._thread.join()
        os.close(self._pipe)
        self._file.close()
        self._check()

    def _check(self) -> None:
        if self._error is not None:
            raise self._error

    def _waiting(self) -> bool:
        with self._busy:
            return self._readable(0.0) and self._thread.is_alive()

    def _readable(self, timeout: float | None = None) -> bool:
        poll = select.poll()  # select knows no descriptors above 1023
        poll.register(self._pipe, select.POLLIN)
        return bool(poll.poll(timeout))

    def _copy(self) -> None:
        """Copy until the stream is closed; after an error the pipe is emptied all the same."""
        while True:
            self._readable()
            with self._busy:
                data = os.read(self._pipe, PIECE)
                if not data:
                    return
                try:
                    rest = memoryview(data if self._error is None else b"")
                    while rest:
                        rest = rest[self._file.write(rest) :]
                except OSError as error:
                    self._error = error
