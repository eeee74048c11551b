"""Reports of a session as one self-contained file."""

from flexviz.report.content import chosen_set, diagnosed_session, guarded
from flexviz.report.writing import KINDS, session_report

__all__ = ["KINDS", "chosen_set", "diagnosed_session", "guarded", "session_report"]
