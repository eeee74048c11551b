"""Records of a result: parameters, errors, findings, models on the way, curves, notes."""

from flexviz.content.records.criterion import CriterionNumbers, Resolution
from flexviz.content.records.curves import CurveTable, FreeCurve, ResidualLocation, ResidualMap, curve_tables
from flexviz.content.records.entries import (
    GainsEntry,
    GroupError,
    ModelEntry,
    ObserverEntry,
    ResidualSummary,
    StepEntry,
    TorqueEntry,
)
from flexviz.content.records.findings import Absorbed, CandidateEffect, Family, FoundEffect, Tie
from flexviz.content.records.joint_errors import (
    FOLLOWING,
    PERCENT,
    TORQUE,
    JointErrors,
    mean_nrms,
    normalised,
    percent_of,
    stated_errors,
    total_rms,
)
from flexviz.content.records.notes import (
    NOTE_KINDS,
    DetectionLimit,
    Grade,
    LimitReason,
    Note,
    NoteKind,
    Verdict,
)
from flexviz.content.records.parameters import (
    NOT_DETERMINED,
    Combination,
    EffectEntry,
    EffectParameter,
    Interval,
    ParameterEstimate,
    is_determined,
)
from flexviz.content.records.protocols import DiagnosisLike, ErrorsLike
from flexviz.content.records.recording import RecordingEntry
from flexviz.content.records.shares import FindingKey, finding_key, found_shares, step_shares
from flexviz.content.records.trace import Decoys, Move

__all__ = [
    "FOLLOWING",
    "NOTE_KINDS",
    "NOT_DETERMINED",
    "PERCENT",
    "TORQUE",
    "Absorbed",
    "CandidateEffect",
    "Combination",
    "CriterionNumbers",
    "CurveTable",
    "Decoys",
    "DetectionLimit",
    "DiagnosisLike",
    "EffectEntry",
    "EffectParameter",
    "ErrorsLike",
    "Family",
    "FindingKey",
    "FoundEffect",
    "FreeCurve",
    "GainsEntry",
    "Grade",
    "GroupError",
    "Interval",
    "JointErrors",
    "LimitReason",
    "ModelEntry",
    "Move",
    "Note",
    "NoteKind",
    "ObserverEntry",
    "ParameterEstimate",
    "RecordingEntry",
    "ResidualLocation",
    "ResidualMap",
    "ResidualSummary",
    "Resolution",
    "StepEntry",
    "Tie",
    "TorqueEntry",
    "Verdict",
    "curve_tables",
    "finding_key",
    "found_shares",
    "is_determined",
    "mean_nrms",
    "normalised",
    "percent_of",
    "stated_errors",
    "step_shares",
    "total_rms",
]
