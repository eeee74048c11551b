"""Measurement noise, and what recorded signals can be trusted for."""

from flexviz.data.noise.check import check_signals, noise_notes
from flexviz.data.noise.estimates import resolution, segments_noise, white_noise
from flexviz.data.noise.filtered import FilteredLog, filtered_before_writing
from flexviz.data.noise.findings import Channel, Remedy, SampleFinding
from flexviz.data.noise.jumps import check_jumps, column_findings, outliers
from flexviz.data.noise.outside import GroupSamples, check_outside
from flexviz.data.noise.registers import has_sign_bit, may_be_signed, sign_bit, sign_magnitude, unwrapped
from flexviz.data.noise.repeats import check_repeats, new_rows

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
    "has_sign_bit",
    "may_be_signed",
    "new_rows",
    "noise_notes",
    "outliers",
    "resolution",
    "segments_noise",
    "sign_bit",
    "sign_magnitude",
    "unwrapped",
    "white_noise",
]
