"""Many measurement sets, and studies of many runs, on local processes or a cluster."""

from flexviz.batch.analysis import SetOptions
from flexviz.batch.batch import BatchOutcome, is_batch, read_batch, run_batch, set_results
from flexviz.batch.cluster import Answer, ClusterChoice, SchedulerLost, spread
from flexviz.batch.fleet import Outlier, ParameterHistory, histories, outliers
from flexviz.batch.listing import about_html, fleet_html
from flexviz.batch.page import drift_text, found_text, history_chart, parameter_words, verdict_words
from flexviz.batch.rows import FleetRow, FleetValue
from flexviz.batch.running import RunCount
from flexviz.batch.study import StudyOutcome, run_study
from flexviz.batch.study_page import ParameterSpread, detected, detection_limit, spreads
from flexviz.batch.study_plan import StudyPlan, StudyRun

__all__ = [
    "Answer",
    "BatchOutcome",
    "ClusterChoice",
    "FleetRow",
    "FleetValue",
    "Outlier",
    "ParameterHistory",
    "ParameterSpread",
    "RunCount",
    "SchedulerLost",
    "SetOptions",
    "StudyOutcome",
    "StudyPlan",
    "StudyRun",
    "about_html",
    "detected",
    "detection_limit",
    "drift_text",
    "fleet_html",
    "found_text",
    "histories",
    "history_chart",
    "is_batch",
    "outliers",
    "parameter_words",
    "read_batch",
    "run_batch",
    "run_study",
    "set_results",
    "spread",
    "spreads",
    "verdict_words",
]
