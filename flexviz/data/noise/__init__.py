"""Measurement noise, counts, repeated values and jumps of recorded signals, as far as samples show them."""

from flexviz.data.noise.channels import Channel
from flexviz.data.noise.counts import ENOUGH, count_of, in_counts
from flexviz.data.noise.estimates import UNIFORM, resolution, segments_noise, sudden_noise, white_noise
from flexviz.data.noise.jumps import SHORTEST, jumped, outliers
from flexviz.data.noise.registers import SLACK, sign_magnitude, unwrapped
from flexviz.data.noise.repeats import Repeats, new_rows, repeats_of, smallest_step
from flexviz.data.noise.thresholds import SHORT

__all__ = [
    "ENOUGH",
    "SHORT",
    "SHORTEST",
    "SLACK",
    "UNIFORM",
    "Channel",
    "Repeats",
    "count_of",
    "in_counts",
    "jumped",
    "new_rows",
    "outliers",
    "repeats_of",
    "resolution",
    "segments_noise",
    "sign_magnitude",
    "smallest_step",
    "sudden_noise",
    "unwrapped",
    "white_noise",
]
