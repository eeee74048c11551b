"""Many measurement sets, and studies of many runs, on local processes or a cluster."""

from flexviz.batch.analysis import SetOptions
from flexviz.batch.batch import BatchOutcome, is_batch, read_batch, run_batch, set_results
from flexviz.batch.cluster import Answer, ClusterChoice, SchedulerLost, spread
from flexviz.batch.fleet import Outlier, ParameterHistory, histories, outliers
from flexviz.batch.page import drift_text, found_text, history_chart, parameter_words, verdict_words
from flexviz.batch.rows import FleetRow, FleetValue
from flexviz.batch.running import RunCount

__all__ = [
    "Answer",
    "BatchOutcome",
    "ClusterChoice",
    "FleetRow",
    "FleetValue",
    "Outlier",
    "ParameterHistory",
    "RunCount",
    "SchedulerLost",
    "SetOptions",
    "drift_text",
    "found_text",
    "histories",
    "history_chart",
    "is_batch",
    "outliers",
    "parameter_words",
    "read_batch",
    "run_batch",
    "set_results",
    "spread",
    "verdict_words",
]
