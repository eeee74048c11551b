"""An open recording that logs to a file, to a running viewer, or to both.

The file holds everything up to the last `flush`, even after a crash; `close` adds the footer. If the viewer
disconnects, the file is still written.
"""

from __future__ import annotations

import socket
from collections.abc import Iterable
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb

from flexviz.base.errors import InputError
from flexviz.base.files import named_errors
from flexviz.outlets.recording.file_sink import FileSink
from flexviz.outlets.recording.files import Target
from flexviz.outlets.recording.paths import APPLICATION

VIEWER = "rerun+http://127.0.0.1:9876/proxy"  # where a viewer started with `rerun` listens
SCHEMES = ("rerun", "rerun+http", "rerun+https")
VIEWER_TIMEOUT = 2.0  # [s]


def viewer_address(text: str) -> str:
    """The complete address of a running viewer from "", a port, host:port or an address.

    Raises:
        InputError: not an address, or nothing answers there.
    """
    if not text:
        whole = VIEWER
    elif text.isdigit():
        whole = f"rerun+http://127.0.0.1:{text}/proxy"
    else:
        whole = text if "://" in text else f"rerun+http://{text}/proxy"
    try:
        parts = urlsplit(whole)
        host, port = parts.hostname, parts.port or 9876
    except ValueError:
        host, port, parts = None, 0, urlsplit("")
    if host is None or parts.scheme not in SCHEMES:
        raise InputError(f'"{text}" is not the address of a Rerun viewer, expected {VIEWER} or its port')
    try:
        socket.create_connection((host, port), timeout=VIEWER_TIMEOUT).close()
    except OSError:
        raise InputError(
            f"no Rerun viewer answers at {host}:{port}: start one with `rerun`, or leave the viewer out"
        ) from None
    return whole


class Stream:
    """An open recording: Rerun's methods, applied to the file and the viewer.

    Attributes:
        target: the file, or None.
        entities: all logged entities.
        lost: why the viewer no longer receives data, or "".
    """

    def __init__(self, name: str, target: Target | None, viewer: str | None = None) -> None:
        """`name` is that of the measurement set, `viewer` a complete address (`viewer_address`)."""
        self.target = target
        self.entities: set[str] = set()
        self.lost = ""
        identity = uuid4()
        application = f"{APPLICATION} {name}"  # the viewer stores changed layouts by it
        self._file: rr.RecordingStream | None = None
        self._viewer: rr.RecordingStream | None = None
        if target is not None:
            self._file = rr.RecordingStream(application, recording_id=identity)
            self._sink = FileSink(self._file, target.now)
        if viewer is not None:
            self._viewer = rr.RecordingStream(application, recording_id=identity)
            self._viewer.connect_grpc(viewer)

    @property
    def _open(self) -> list[rr.RecordingStream]:
        return [stream for stream in (self._file, self._viewer) if stream is not None]

    def name(self, text: str) -> None:
        """Name the recording in the viewer."""
        for stream in self._open:
            stream.send_recording_name(text)

    def property(self, name: str, **values: Any) -> None:
        """Set properties of the whole recording; empty lists are omitted."""
        given = {key: value for key, value in values.items() if not isinstance(value, list) or value}
        for stream in self._open:
            stream.send_property(name, rr.AnyValues(drop_untyped_nones=True, **given))

    def blueprint(self, layout: rrb.Blueprint) -> None:
        """Set the viewer's layout."""
        for stream in self._open:
            stream.send_blueprint(layout, make_active=True, make_default=True)

    def log(self, entity: str, *what: Any, static: bool = False) -> None:
        """Log at the current time, or for all times (`static`)."""
        self.entities.add(entity)
        for stream in self._open:
            stream.log(entity, *what, static=static)

    def send_columns(self, entity: str, indexes: Iterable[Any], columns: Iterable[Any]) -> None:
        """Log many instants at once."""
        self.entities.add(entity)
        indexes, columns = list(indexes), list(columns)
        for stream in self._open:
            stream.send_columns(entity, indexes, columns)

    def text(self, entity: str, markdown: str) -> None:
        """Log a text for all times, replacing an earlier one."""
        self.log(entity, rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN), static=True)

    def flush(self) -> None:
        """Write everything logged so far.

        Raises:
            InputError: the file cannot be written.
        """
        if self._file is not None and self.target is not None:
            with named_errors(self.target.file):
                self._sink.flush()
                self.target.appear()
        if self._viewer is not None:
            try:
                self._viewer.flush(timeout_sec=VIEWER_TIMEOUT)
            except (RuntimeError, ValueError) as error:
                self.lost = str(error)
                self._viewer = None  # this ends its connection

    def close(self) -> None:
        """Write the footer and disconnect the viewer; a closed stream ignores further calls.

        Raises:
            InputError: the file cannot be written.
        """
        file, viewer = self._file, self._viewer
        self._file = self._viewer = None
        if viewer is not None:
            viewer.disconnect()
        if file is not None and self.target is not None:
            with named_errors(self.target.file, "completed, but what was recorded is kept"):
                self._sink.close()
