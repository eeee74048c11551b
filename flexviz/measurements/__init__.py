"""Measurement sets: read, check and write what was recorded on a robot's motor side."""

from __future__ import annotations

from flexviz.measurements.data import Group, MeasurementSet, Segment
from flexviz.measurements.reading import read_set
from flexviz.measurements.selection import low_speed_threshold, moving
from flexviz.measurements.writing import GroupTable, copy_set, write_set

__all__ = [
    "Group",
    "GroupTable",
    "MeasurementSet",
    "Segment",
    "copy_set",
    "low_speed_threshold",
    "moving",
    "read_set",
    "write_set",
]
