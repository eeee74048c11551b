"""Measurement sets: read, check and write what was recorded on a robot's motor side."""

from __future__ import annotations

from flexviz.measurements.data import Group, MeasurementSet, Segment

__all__ = ["Group", "MeasurementSet", "Segment"]
