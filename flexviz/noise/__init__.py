"""Measurement noise, and what recorded signals can be trusted for."""

from flexviz.noise.check import check_signals, noise_notes
from flexviz.noise.estimates import resolution, segments_noise, white_noise
from flexviz.noise.filtered import FilteredLog, filtered_before_writing
from flexviz.noise.findings import Channel, Remedy, SampleFinding
from flexviz.noise.jumps import check_jumps, column_findings, outliers
from flexviz.noise.outside import GroupSamples, check_outside
from flexviz.noise.registers import sign_magnitude, unwrapped
from flexviz.noise.repeats import check_repeats, new_rows

__all__ = [
    "Channel",
    "FilteredLog",
    "GroupSamples",
    "Remedy",
    "SampleFinding",
    "check_jumps",
    "check_outside",
    "check_repeats",
    "check_signals",
    "column_findings",
    "filtered_before_writing",
    "new_rows",
    "noise_notes",
    "outliers",
    "resolution",
    "segments_noise",
    "sign_magnitude",
    "unwrapped",
    "white_noise",
]
