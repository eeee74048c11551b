"""Measurement sets: read, check and write what was recorded on a robot's motor side."""

from flexviz.data.measurements.bridging import GAP, bridge
from flexviz.data.measurements.damage import CELL, Damage, RecordError, cut_off, first_damage, has_zeros
from flexviz.data.measurements.data import (
    OPTIONAL_SIGNALS,
    Array,
    FileHash,
    Fingerprint,
    Group,
    Segment,
)
from flexviz.data.measurements.drive import FARTHEST, LEAST_GOALS, Drive
from flexviz.data.measurements.group_reading import read_payloads, read_robot
from flexviz.data.measurements.group_table import GroupTable
from flexviz.data.measurements.holds import HoldGroup, Holds, find_holds
from flexviz.data.measurements.measurement_set import (
    MeasurementSet,
    fingerprint,
    require_unchanged,
    same_recording,
)
from flexviz.data.measurements.overview import SetOverview, overview
from flexviz.data.measurements.reading import read_set, set_of
from flexviz.data.measurements.robot_in_set import robot_files
from flexviz.data.measurements.sampled_motion import SampledMotion, sample_motion
from flexviz.data.measurements.schema import (
    FILE_NAME,
    Clamped,
    GroupKind,
    SetHeader,
    Temperatures,
    TorqueSide,
    check_clamped,
)
from flexviz.data.measurements.segments import POINTS, interpolate, pieces
from flexviz.data.measurements.tables import readable, row_name
from flexviz.data.measurements.time_units import wrong_time_unit
from flexviz.data.measurements.writing import SUFFIXES, check_free, write_set

__all__ = [
    "CELL",
    "FARTHEST",
    "FILE_NAME",
    "GAP",
    "LEAST_GOALS",
    "OPTIONAL_SIGNALS",
    "POINTS",
    "SUFFIXES",
    "Array",
    "Clamped",
    "Damage",
    "Drive",
    "FileHash",
    "Fingerprint",
    "Group",
    "GroupKind",
    "GroupTable",
    "HoldGroup",
    "Holds",
    "MeasurementSet",
    "RecordError",
    "SampledMotion",
    "Segment",
    "SetHeader",
    "SetOverview",
    "Temperatures",
    "TorqueSide",
    "bridge",
    "check_clamped",
    "check_free",
    "cut_off",
    "find_holds",
    "fingerprint",
    "first_damage",
    "has_zeros",
    "interpolate",
    "overview",
    "pieces",
    "read_payloads",
    "read_robot",
    "read_set",
    "readable",
    "require_unchanged",
    "robot_files",
    "row_name",
    "same_recording",
    "sample_motion",
    "set_of",
    "write_set",
    "wrong_time_unit",
]
