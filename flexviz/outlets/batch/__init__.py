"""Many measurement sets, and studies of many runs, on local processes or a cluster."""

from flexviz.outlets.batch.analysis import SetOptions
from flexviz.outlets.batch.batch import BatchOutcome, is_batch, read_batch, run_batch, set_results
from flexviz.outlets.batch.cluster import ClusterChoice, SchedulerLost, spread
from flexviz.outlets.batch.fleet import histories, outliers
from flexviz.outlets.batch.listing import about_set, fleet_html
from flexviz.outlets.batch.page import counted_verdicts, drift_text, history_chart
from flexviz.outlets.batch.repeatability import Repeatability, RepeatedFinding, RepeatedValue, repeatability
from flexviz.outlets.batch.repeatability_page import parameter_words, repeatability_lines
from flexviz.outlets.batch.rows import FleetRow
from flexviz.outlets.batch.study import StudyOutcome, run_study
from flexviz.outlets.batch.study_page import study_sections
from flexviz.outlets.batch.study_plan import StudyPlan, StudyRun

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
    "about_set",
    "counted_verdicts",
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
    "study_sections",
]
