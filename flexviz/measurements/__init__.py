"""Measurement sets: read, check and write what was recorded on a robot's motor side."""

from flexviz.measurements.bridging import GAP, bridge
from flexviz.measurements.data import (
    OPTIONAL_SIGNALS,
    Array,
    FileHash,
    Fingerprint,
    Group,
    MeasurementSet,
    Segment,
    fingerprint,
    require_unchanged,
)
from flexviz.measurements.overview import SetOverview, overview
from flexviz.measurements.reading import read_payloads, read_robot, read_set
from flexviz.measurements.schema import FILE_NAME, SetHeader, Temperatures
from flexviz.measurements.segments import POINTS, interpolate, pieces
from flexviz.measurements.tables import readable, row_name
from flexviz.measurements.unit_checks import SampledMotion, likely_limits, sample_motion, wrong_time_unit
from flexviz.measurements.writing import SUFFIXES, GroupTable, check_free, write_set

__all__ = [
    "FILE_NAME",
    "GAP",
    "OPTIONAL_SIGNALS",
    "POINTS",
    "SUFFIXES",
    "Array",
    "FileHash",
    "Fingerprint",
    "Group",
    "GroupTable",
    "MeasurementSet",
    "SampledMotion",
    "Segment",
    "SetHeader",
    "SetOverview",
    "Temperatures",
    "bridge",
    "check_free",
    "fingerprint",
    "interpolate",
    "likely_limits",
    "overview",
    "pieces",
    "read_payloads",
    "read_robot",
    "read_set",
    "readable",
    "require_unchanged",
    "row_name",
    "sample_motion",
    "write_set",
    "wrong_time_unit",
]
