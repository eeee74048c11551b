"""Record an analysis for the Rerun viewer, check and open recordings: the only place that imports rerun."""

from __future__ import annotations

from flexviz.recording.checking import Checked, TruncatedRecording, check_recording
from flexviz.recording.files import Recorded
from flexviz.recording.live import LiveRecording
from flexviz.recording.reading import Recording, read_recording
from flexviz.recording.repairing import repair_recording
from flexviz.recording.sessions import record_session
from flexviz.recording.writing import RecordingFile, ending_tidily, record_set

__all__ = [
    "Checked",
    "LiveRecording",
    "Recorded",
    "Recording",
    "RecordingFile",
    "TruncatedRecording",
    "check_recording",
    "ending_tidily",
    "read_recording",
    "record_session",
    "record_set",
    "repair_recording",
]
