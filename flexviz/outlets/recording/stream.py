"""An open recording that logs to a file.

The file holds everything up to the last `flush`, even after a crash; `close` adds the footer.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb

from flexviz.base.files import named_errors
from flexviz.outlets.recording.file_sink import FileSink
from flexviz.outlets.recording.files import Target
from flexviz.outlets.recording.paths import APPLICATION


class Stream:
    """An open recording: Rerun's methods, and all logged entities.

    Attributes:
        target: the file.
        entities: all logged entities.
    """

    def __init__(self, name: str, target: Target) -> None:
        """`name` is that of the measurement set; the viewer stores changed layouts by it."""
        self.target = target
        self.entities: set[str] = set()
        self._stream = rr.RecordingStream(f"{APPLICATION} {name}", recording_id=uuid4())
        self._sink = FileSink(self._stream, target.now)
        self._closed = False

    def name(self, text: str) -> None:
        """Name the recording in the viewer."""
        self._stream.send_recording_name(text)

    def property(self, name: str, **values: Any) -> None:
        """Set properties of the whole recording; empty lists are omitted."""
        given = {key: value for key, value in values.items() if not isinstance(value, list) or value}
        self._stream.send_property(name, rr.AnyValues(drop_untyped_nones=True, **given))

    def blueprint(self, layout: rrb.Blueprint) -> None:
        """Set the viewer's layout."""
        self._stream.send_blueprint(layout, make_active=True, make_default=True)

    def log(self, entity: str, *what: Any, static: bool = False) -> None:
        """Log at the current time, or for all times (`static`)."""
        self.entities.add(entity)
        self._stream.log(entity, *what, static=static)

    def send_columns(self, entity: str, indexes: Iterable[Any], columns: Iterable[Any]) -> None:
        """Log many instants at once."""
        self.entities.add(entity)
        self._stream.send_columns(entity, indexes, columns)

    def text(self, entity: str, markdown: str) -> None:
        """Log a text for all times, replacing an earlier one."""
        self.log(entity, rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN), static=True)

    def flush(self) -> None:
        """Write everything logged so far.

        Raises:
            InputError: the file cannot be written.
        """
        with named_errors(self.target.file):
            self._sink.flush()
            self.target.appear()

    def close(self) -> None:
        """Write the footer; a closed stream ignores further calls.

        Raises:
            InputError: the file cannot be written.
        """
        if not self._closed:
            self._closed = True
            with named_errors(self.target.file, "completed, but what was recorded is kept"):
                self._sink.close()
