"""Record an analysis for the Rerun viewer: the only place that imports rerun."""

from __future__ import annotations

from flexviz.recording.checking import Checked, check_recording
from flexviz.recording.files import Recorded
from flexviz.recording.live import LiveRecording
from flexviz.recording.writing import RecordingFile, record_set

__all__ = ["Checked", "LiveRecording", "Recorded", "RecordingFile", "check_recording", "record_set"]
