"""Record an analysis for the Rerun viewer: the only place that imports rerun."""

from __future__ import annotations

from flexviz.recording.checking import Checked, check_recording
from flexviz.recording.writing import Recorded, record_set

__all__ = ["Checked", "Recorded", "check_recording", "record_set"]
