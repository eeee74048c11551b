"""Reports of a session as one self-contained file."""

from flexviz.report.content import diagnosed_session
from flexviz.report.writing import session_report

__all__ = ["diagnosed_session", "session_report"]
