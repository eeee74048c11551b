"""Reports as one self-contained file: of a session, or of any sections of paragraphs, tables and charts."""

from flexviz.outlets.report.animation import session_animation
from flexviz.outlets.report.blocks import (
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
from flexviz.outlets.report.content import diagnosed_session
from flexviz.outlets.report.html import html
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
