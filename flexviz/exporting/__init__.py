"""What was found, in the formats that others read: URDF, MJCF, YAML, JSON, C and Python."""

from flexviz.exporting.coverage import Entry, LeftOut, Written, coverage
from flexviz.exporting.documents import Document, read_result
from flexviz.exporting.subject import Subject, check_payload, subject_of
from flexviz.exporting.writing import FORMATS, Exported, check_folder, check_formats, export, write

__all__ = [
    "FORMATS",
    "Document",
    "Entry",
    "Exported",
    "LeftOut",
    "Subject",
    "Written",
    "check_folder",
    "check_formats",
    "check_payload",
    "coverage",
    "export",
    "read_result",
    "subject_of",
    "write",
]
