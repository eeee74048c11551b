"""Reports: what was found about a robot, in one file that needs nothing else."""

from flexviz.report.completing import chosen_set, guarded
from flexviz.report.gathering import diagnosed_session
from flexviz.report.writing import KINDS, session_report

__all__ = ["KINDS", "chosen_set", "diagnosed_session", "guarded", "session_report"]
