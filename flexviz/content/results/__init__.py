"""Results: the results document, verdicts and grades, lookup of parameters by name."""

from flexviz.content.results.assessment import assessment, at_bounds, hints, lacks_effects, torque_side
from flexviz.content.results.bandwidth import BandwidthCheck, GuardEntry, ParameterCurve
from flexviz.content.results.charts import evidence_chart, staircase_chart
from flexviz.content.results.document import (
    SUFFIXES,
    ResultDocument,
    checked_document,
    curve_entries,
    json_schema,
    note_entries,
    read_result,
    shared_fields,
)
from flexviz.content.results.fields import DiagnosisFields, FitFields
from flexviz.content.results.frame import DataFrame, parameter_frame
from flexviz.content.results.law_chart import law_chart, law_difference
from flexviz.content.results.link_side import LinkSide
from flexviz.content.results.lookup import ParameterNotFound, find_parameter

__all__ = [
    "SUFFIXES",
    "BandwidthCheck",
    "DataFrame",
    "DiagnosisFields",
    "FitFields",
    "GuardEntry",
    "LinkSide",
    "ParameterCurve",
    "ParameterNotFound",
    "ResultDocument",
    "assessment",
    "at_bounds",
    "checked_document",
    "curve_entries",
    "evidence_chart",
    "find_parameter",
    "hints",
    "json_schema",
    "lacks_effects",
    "law_chart",
    "law_difference",
    "note_entries",
    "parameter_frame",
    "read_result",
    "shared_fields",
    "staircase_chart",
    "torque_side",
]
