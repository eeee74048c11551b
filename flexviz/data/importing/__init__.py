"""Import ROS bags, MCAP, CSV, Excel, Parquet, MATLAB, NumPy, JSON and LeRobot logs as a measurement set."""

from flexviz.data.importing.column_names import ANGLE, CURRENT, FORCE, LENGTH, TIME, TORQUE
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
from flexviz.data.importing.mapping import Fix, Issue, Mapping, read_mapping
from flexviz.data.importing.plausibility import (
    issues_of_set,
    plausibility_warnings,
    with_plausibility_warnings,
)
from flexviz.data.importing.previewing import ColumnPreview, LogPreview, preview, readable
from flexviz.data.importing.proposals import Proposal

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
    "Issue",
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
    "issues_of_set",
    "plausibility_warnings",
    "preview",
    "read_mapping",
    "readable",
    "set_column",
    "set_constants",
    "set_key",
    "typed_numbers",
    "with_plausibility_warnings",
]
