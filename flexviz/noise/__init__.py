"""Measurement noise, and what recorded signals can be trusted for."""

from flexviz.noise.check import check_signals, noise_notes
from flexviz.noise.estimates import resolution, segments_noise, white_noise
from flexviz.noise.faults import Fault, column_faults
from flexviz.noise.filtered import FilteredLog, filtered_before_writing

__all__ = [
    "Fault",
    "FilteredLog",
    "check_signals",
    "column_faults",
    "filtered_before_writing",
    "noise_notes",
    "resolution",
    "segments_noise",
    "white_noise",
]
