"""Results: the results document, verdicts and grades, lookup of parameters by name."""

from flexviz.results.assessment import assessment, hints, lacks_effects
from flexviz.results.bandwidth import BandwidthCheck, ParameterCurve
from flexviz.results.base import Grade, Note, NoteKind, Verdict
from flexviz.results.curves import FreeCurve, ResidualLocation, ResidualMap, curve_tables
from flexviz.results.document import ResultDocument, curve_entries, json_schema, note_entries, read_result
from flexviz.results.entries import CandidateEntry, EffectEntry, ObserverEntry, ValueEntry
from flexviz.results.findings import Absorbed, Family, Tie
from flexviz.results.lookup import ParameterNotFound, find_parameter
from flexviz.results.summary import WIDE, markdown, parts, run_lines
from flexviz.results.tables import interval, plain_table
from flexviz.results.trace import Move

__all__ = [
    "WIDE",
    "Absorbed",
    "BandwidthCheck",
    "CandidateEntry",
    "EffectEntry",
    "Family",
    "FreeCurve",
    "Grade",
    "Move",
    "Note",
    "NoteKind",
    "ObserverEntry",
    "ParameterCurve",
    "ParameterNotFound",
    "ResidualLocation",
    "ResidualMap",
    "ResultDocument",
    "Tie",
    "ValueEntry",
    "Verdict",
    "assessment",
    "curve_entries",
    "curve_tables",
    "find_parameter",
    "hints",
    "interval",
    "json_schema",
    "lacks_effects",
    "markdown",
    "note_entries",
    "parts",
    "plain_table",
    "read_result",
    "run_lines",
]
