"""Reports as one self-contained file: of a session, or of any sections of paragraphs, tables and charts."""

from flexviz.content.blocks import (
    Block,
    Callout,
    Cell,
    ReportDocument,
    Section,
    Tile,
    Tiles,
    explanation,
    section,
    table,
)
from flexviz.content.rendering import html
from flexviz.content.topics import diagnosed_session
from flexviz.outlets.report.animation import session_animation
from flexviz.outlets.report.writing import session_report

__all__ = [
    "Block",
    "Callout",
    "Cell",
    "ReportDocument",
    "Section",
    "Tile",
    "Tiles",
    "diagnosed_session",
    "explanation",
    "html",
    "section",
    "session_animation",
    "session_report",
    "table",
]
