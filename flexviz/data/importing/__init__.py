"""Import ROS bags, MCAP, CSV, Excel, Parquet, MATLAB, NumPy, JSON and LeRobot logs as a measurement set."""

from flexviz.data.importing.draft import Draft, DraftJoint, Person, Questions
from flexviz.data.importing.editing import (
    add_payload,
    carry,
    currents,
    edited,
    gaps,
    set_column,
    set_constants,
    set_key,
    typed_numbers,
)
from flexviz.data.importing.importing import Imported, import_logs
from flexviz.data.importing.inspecting import Inspection, inspect_logs
from flexviz.data.importing.previewing import ColumnPreview, LogPreview, preview, readable
from flexviz.data.logs import (
    ANGLE,
    CURRENT,
    FORCE,
    LENGTH,
    TIME,
    TORQUE,
    Fix,
    Mapping,
    Proposal,
    read_mapping,
)

__all__ = [
    "ANGLE",
    "CURRENT",
    "FORCE",
    "LENGTH",
    "TIME",
    "TORQUE",
    "ColumnPreview",
    "Draft",
    "DraftJoint",
    "Fix",
    "Imported",
    "Inspection",
    "LogPreview",
    "Mapping",
    "Person",
    "Proposal",
    "Questions",
    "add_payload",
    "carry",
    "currents",
    "edited",
    "gaps",
    "import_logs",
    "inspect_logs",
    "preview",
    "read_mapping",
    "readable",
    "set_column",
    "set_constants",
    "set_key",
    "typed_numbers",
]
