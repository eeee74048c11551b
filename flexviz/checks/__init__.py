"""A recording compared with its robot: what is wrong with its columns, its samples and what is stated of it.

One rigid model judges what may be wrong (`hypotheses`); the common search finds the most probable.
"""

from flexviz.checks import hypotheses  # registers what may be wrong
from flexviz.checks.columns import check_optional_columns
from flexviz.checks.faults import HYPOTHESES, Case, Fault, hypothesis
from flexviz.checks.groups import check_groups
from flexviz.checks.issues import Issue, Severity, with_sliding
from flexviz.checks.references import check_references, unmeasured
from flexviz.checks.rigid import Comparison, LoadedTable
from flexviz.checks.sets import (
    contradictions,
    issues_of_set,
    plausibility_warnings,
    recording_entries,
    with_plausibility_warnings,
)
from flexviz.checks.thresholds import LIMITS

__all__ = [
    "HYPOTHESES",
    "LIMITS",
    "Case",
    "Comparison",
    "Fault",
    "Issue",
    "LoadedTable",
    "Severity",
    "check_groups",
    "check_optional_columns",
    "check_references",
    "contradictions",
    "hypotheses",
    "hypothesis",
    "issues_of_set",
    "plausibility_warnings",
    "recording_entries",
    "unmeasured",
    "with_plausibility_warnings",
    "with_sliding",
]
