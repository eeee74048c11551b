"""Many measurement sets, and studies of many runs, on local processes or a cluster."""

from flexviz.batch.analysis import SetOptions
from flexviz.batch.batch import BatchOutcome, is_batch, read_batch, run_batch, set_results
from flexviz.batch.cluster import ClusterChoice, SchedulerLost, spread
from flexviz.batch.fleet import histories, outliers
from flexviz.batch.listing import about_html, fleet_html
from flexviz.batch.page import counted_verdicts, drift_text, history_chart
from flexviz.batch.repeatability import Repeatability, RepeatedFinding, RepeatedValue, repeatability
from flexviz.batch.repeatability_page import parameter_words, repeatability_lines
from flexviz.batch.rows import FleetRow
from flexviz.batch.study import StudyOutcome, run_study
from flexviz.batch.study_page import detected, detection_limit, spreads
from flexviz.batch.study_plan import StudyPlan, StudyRun

__all__ = [
    "BatchOutcome",
    "ClusterChoice",
    "FleetRow",
    "Repeatability",
    "RepeatedFinding",
    "RepeatedValue",
    "SchedulerLost",
    "SetOptions",
    "StudyOutcome",
    "StudyPlan",
    "StudyRun",
    "about_html",
    "counted_verdicts",
    "detected",
    "detection_limit",
    "drift_text",
    "fleet_html",
    "histories",
    "history_chart",
    "is_batch",
    "outliers",
    "parameter_words",
    "read_batch",
    "repeatability",
    "repeatability_lines",
    "run_batch",
    "run_study",
    "set_results",
    "spread",
    "spreads",
]
