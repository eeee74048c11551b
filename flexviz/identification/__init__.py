"""Identification: parameters with uncertainty from measurements."""

from flexviz.identification.bandwidth_sweep import SweepResult, sweep
from flexviz.identification.pipeline import identify
from flexviz.identification.preview import ObservedResidual, ResidualPreview
from flexviz.identification.result import (
    Combination,
    Identification,
    ParameterEstimate,
    ResidualSeries,
    ResidualSummary,
)
from flexviz.identification.summary import combinations, parameter_estimates

__all__ = [
    "Combination",
    "Identification",
    "ObservedResidual",
    "ParameterEstimate",
    "ResidualPreview",
    "ResidualSeries",
    "ResidualSummary",
    "SweepResult",
    "combinations",
    "identify",
    "parameter_estimates",
    "sweep",
]
