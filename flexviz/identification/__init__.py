"""Identification: parameters with uncertainty from measurements."""

from flexviz.identification.identify import identify
from flexviz.identification.result import (
    Combination,
    Identification,
    ParameterEstimate,
    ResidualSeries,
    ResidualSummary,
)
from flexviz.identification.summary import combinations, parameter_estimates
from flexviz.identification.sweep import SweepResult, sweep

__all__ = [
    "Combination",
    "Identification",
    "ParameterEstimate",
    "ResidualSeries",
    "ResidualSummary",
    "SweepResult",
    "combinations",
    "identify",
    "parameter_estimates",
    "sweep",
]
