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
from flexviz.content.records.notes import DetectionLimit, Grade, LimitReason, Note, NoteKind, Verdict
from flexviz.content.records.parameters import (
    NOT_DETERMINED,
    Combination,
    EffectEntry,
    EffectParameter,
    Interval,
    ParameterEstimate,
    is_determined,
)
from flexviz.content.records.recording import RecordingEntry
from flexviz.content.records.trace import Decoys, Move

__all__ = [
    "NOT_DETERMINED",
    "Absorbed",
    "CandidateEffect",
    "Combination",
    "CriterionNumbers",
    "CurveTable",
    "Decoys",
    "DetectionLimit",
    "EffectEntry",
    "EffectParameter",
    "Family",
    "FoundEffect",
    "FreeCurve",
    "GainsEntry",
    "Grade",
    "GroupError",
    "Interval",
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
    "is_determined",
]
