"""Export of an identified robot as URDF, MJCF, YAML, JSON, C, Python and tables."""

from flexviz.outlets.exporting.coverage import Entry, LeftOut, Written, coverage
from flexviz.outlets.exporting.from_session import session_robot
from flexviz.outlets.exporting.identified import IdentifiedRobot, check_payload, identified_robot
from flexviz.outlets.exporting.writing import (
    FORMATS,
    Exported,
    check_folder,
    check_formats,
    export,
    formats_for,
    write,
)

__all__ = [
    "FORMATS",
    "Entry",
    "Exported",
    "IdentifiedRobot",
    "LeftOut",
    "Written",
    "check_folder",
    "check_formats",
    "check_payload",
    "coverage",
    "export",
    "formats_for",
    "identified_robot",
    "session_robot",
    "write",
]
