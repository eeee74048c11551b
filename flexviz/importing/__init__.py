"""Import ROS bags, MCAP, CSV, Excel, Parquet, MATLAB, NumPy, JSON and LeRobot logs as a measurement set."""

from flexviz.importing.draft import Person, Questions
from flexviz.importing.importing import Imported, import_logs
from flexviz.importing.inspecting import Inspection, inspect_logs
from flexviz.importing.mapping import Issue, Mapping, read_mapping
from flexviz.importing.plausibility import issues_of_set, plausibility_warnings, with_plausibility_warnings

__all__ = [
    "Imported",
    "Inspection",
    "Issue",
    "Mapping",
    "Person",
    "Questions",
    "import_logs",
    "inspect_logs",
    "issues_of_set",
    "plausibility_warnings",
    "read_mapping",
    "with_plausibility_warnings",
]
