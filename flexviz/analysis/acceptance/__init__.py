"""Acceptance: limits on a result, whether it keeps them, and the range for which that holds."""

from flexviz.analysis.acceptance.judging import AcceptanceLine, AcceptanceResult, judge
from flexviz.analysis.acceptance.limits import AcceptanceLimits, read_limits
from flexviz.analysis.acceptance.scope import NOT_PROVED, AcceptanceScope, JointRange, acceptance_scope

__all__ = [
    "NOT_PROVED",
    "AcceptanceLimits",
    "AcceptanceLine",
    "AcceptanceResult",
    "AcceptanceScope",
    "JointRange",
    "acceptance_scope",
    "judge",
    "read_limits",
]
