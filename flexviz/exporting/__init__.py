"""What was found, in the formats that others read: URDF, MJCF, YAML, JSON, C and Python."""

from flexviz.exporting.documents import Document, read_result
from flexviz.exporting.subject import Subject, subject_of
from flexviz.exporting.writing import FORMATS, Exported, check_formats, export, write

__all__ = [
    "FORMATS",
    "Document",
    "Exported",
    "Subject",
    "check_formats",
    "export",
    "read_result",
    "subject_of",
    "write",
]
