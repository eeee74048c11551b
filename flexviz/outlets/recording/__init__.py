"""Recordings for the Rerun viewer: write, check, open. Only this package imports rerun."""

from flexviz.base.errors import require_extra

require_extra("rerun", "a recording")

from flexviz.outlets.recording.live import LiveRecording
from flexviz.outlets.recording.notebook import notebook_viewer
from flexviz.outlets.recording.reading import Recorded, Recording, check_recording, read_recording
from flexviz.outlets.recording.viewers import has_display, show_in_window, web_viewer
from flexviz.outlets.recording.writing import (
    RecordingFile,
    ending_tidily,
    record_session,
    record_set,
    recording_file,
)

__all__ = [
    "LiveRecording",
    "Recorded",
    "Recording",
    "RecordingFile",
    "check_recording",
    "ending_tidily",
    "has_display",
    "notebook_viewer",
    "read_recording",
    "record_session",
    "record_set",
    "recording_file",
    "show_in_window",
    "web_viewer",
]
