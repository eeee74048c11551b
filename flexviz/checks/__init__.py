"""A recording compared with its robot: what is wrong with its columns, its samples and what is stated of it.

One rigid model judges what may be wrong with columns (`hypotheses`); the common search finds the most
probable. What no motion explains is wrong with samples (`masks`).
"""

from flexviz.checks import hypotheses, masks  # registers what may be wrong
from flexviz.checks.columns import check_optional_columns
from flexviz.checks.faults import HYPOTHESES, Case, Fault, hypothesis
from flexviz.checks.groups import check_groups
from flexviz.checks.issues import Issue, Severity, with_sliding
from flexviz.checks.masks.filtered import FilteredLog, filtered_before_writing
from flexviz.checks.masks.jumps import check_jumps
from flexviz.checks.masks.references import unmeasured
from flexviz.checks.masks.saturation import SeenLimit, saturated_joints, seen_limits
from flexviz.checks.masks.silent import silent_joints
from flexviz.checks.noise import check_signals, noise_notes
from flexviz.checks.refusing import refuse_wrong_units
from flexviz.checks.registers import may_be_signed, sign_bit
from flexviz.checks.rigid import Comparison, LoadedTable
from flexviz.checks.samples import (
    MASKS,
    SPOILT,
    AllSamples,
    GroupSamples,
    SampleFinding,
    kept,
    mask,
    mask_of_groups,
    other_samples,
    spoilt_samples,
)
from flexviz.checks.set_samples import samples_of, shortened, spoilt_group
from flexviz.checks.sets import (
    contradictions,
    issues_of_set,
    plausibility_warnings,
    recording_entries,
    with_plausibility_warnings,
)
from flexviz.checks.thresholds import LIMITS
from flexviz.checks.torque_side import behind_gear, torque_evidence

__all__ = [
    "HYPOTHESES",
    "LIMITS",
    "MASKS",
    "SPOILT",
    "AllSamples",
    "Case",
    "Comparison",
    "Fault",
    "FilteredLog",
    "GroupSamples",
    "Issue",
    "LoadedTable",
    "SampleFinding",
    "SeenLimit",
    "Severity",
    "behind_gear",
    "check_groups",
    "check_jumps",
    "check_optional_columns",
    "check_signals",
    "contradictions",
    "filtered_before_writing",
    "hypotheses",
    "hypothesis",
    "issues_of_set",
    "kept",
    "mask",
    "mask_of_groups",
    "masks",
    "may_be_signed",
    "noise_notes",
    "other_samples",
    "plausibility_warnings",
    "recording_entries",
    "refuse_wrong_units",
    "samples_of",
    "saturated_joints",
    "seen_limits",
    "shortened",
    "sign_bit",
    "silent_joints",
    "spoilt_group",
    "spoilt_samples",
    "torque_evidence",
    "unmeasured",
    "with_plausibility_warnings",
    "with_sliding",
]
