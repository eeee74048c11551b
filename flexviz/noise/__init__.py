"""Measurement noise, and what recorded signals can be trusted for."""

from flexviz.noise.check import check_signals, noise_notes
from flexviz.noise.estimates import resolution, segments_noise, white_noise
from flexviz.noise.faults import Fault, column_faults

__all__ = [
    "Fault",
    "check_signals",
    "column_faults",
    "noise_notes",
    "resolution",
    "segments_noise",
    "white_noise",
]
