"""Logs of robots: their formats, a mapping of their columns, and the groups that are assembled from both."""

from flexviz.data.logs.assembling import AssembledGroup, Trace, Traces, assemble
from flexviz.data.logs.clocks import CoarseClock, coarse_clock, guess_clocks, guess_unit, likely_clocks
from flexviz.data.logs.column_names import (
    ANGLE,
    CURRENT,
    FORCE,
    LENGTH,
    TIME,
    TORQUE,
    Meaning,
    Quantity,
    words,
)
from flexviz.data.logs.columns import ColumnFamily, candidates, families_of, pattern
from flexviz.data.logs.columns import reason as reason_of
from flexviz.data.logs.conversions import GEARS, ColumnChange, change_of, conversions, theta_changes
from flexviz.data.logs.formats import LETTERS, LogSource, find_logs, open_run
from flexviz.data.logs.formats.base import EMPTY_FIELD, SHORTEST, Log, ReadOptions, check_stop
from flexviz.data.logs.joint_parts import JointPart, followed, joint_parts
from flexviz.data.logs.mapping import FORMAT as MAPPING_FORMAT
from flexviz.data.logs.mapping import NEEDED, SIGNALS, Fix, Mapping, TimeColumn, read_mapping
from flexviz.data.logs.mapping import parse as parse_mapping
from flexviz.data.logs.proposals import Proposal, proposed

__all__ = [
    "ANGLE",
    "CURRENT",
    "EMPTY_FIELD",
    "FORCE",
    "GEARS",
    "LENGTH",
    "LETTERS",
    "MAPPING_FORMAT",
    "NEEDED",
    "SHORTEST",
    "SIGNALS",
    "TIME",
    "TORQUE",
    "AssembledGroup",
    "CoarseClock",
    "ColumnChange",
    "ColumnFamily",
    "Fix",
    "JointPart",
    "Log",
    "LogSource",
    "Mapping",
    "Meaning",
    "Proposal",
    "Quantity",
    "ReadOptions",
    "TimeColumn",
    "Trace",
    "Traces",
    "assemble",
    "candidates",
    "change_of",
    "check_stop",
    "coarse_clock",
    "conversions",
    "families_of",
    "find_logs",
    "followed",
    "guess_clocks",
    "guess_unit",
    "joint_parts",
    "likely_clocks",
    "open_run",
    "parse_mapping",
    "pattern",
    "proposed",
    "read_mapping",
    "reason_of",
    "theta_changes",
    "words",
]
