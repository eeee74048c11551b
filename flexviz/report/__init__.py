"""Reports: what was found about a robot, in one file that needs nothing else."""

from flexviz.report.content import chosen_set, diagnosed_session, guarded
from flexviz.report.writing import KINDS, session_report

__all__ = ["KINDS", "chosen_set", "diagnosed_session", "guarded", "session_report"]
