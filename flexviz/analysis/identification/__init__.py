"""Identification: parameters with uncertainty from measurements."""

from flexviz.analysis.identification.bandwidth_sweep import SweepResult, sweep
from flexviz.analysis.identification.by_free_motion import by_free_motion
from flexviz.analysis.identification.estimator import Estimate, Estimator
from flexviz.analysis.identification.link_side_check import link_side_checks
from flexviz.analysis.identification.messages import (
    of_samples,
)
from flexviz.analysis.identification.pipeline import identify
from flexviz.analysis.identification.plots import IdentificationPlots, laws_figure
from flexviz.analysis.identification.preview import ObservedResidual, ResidualPreview
from flexviz.analysis.identification.result import Identification, ResidualSeries
from flexviz.analysis.identification.settings import FitOptions, FitSettings, fit_settings
from flexviz.analysis.identification.summary import combinations, grade, parameter_estimates
from flexviz.analysis.identification.thresholds import IDENTIFICATION

__all__ = [
    "IDENTIFICATION",
    "Estimate",
    "Estimator",
    "FitOptions",
    "FitSettings",
    "Identification",
    "IdentificationPlots",
    "ObservedResidual",
    "ResidualPreview",
    "ResidualSeries",
    "SweepResult",
    "by_free_motion",
    "combinations",
    "fit_settings",
    "grade",
    "identify",
    "laws_figure",
    "link_side_checks",
    "of_samples",
    "parameter_estimates",
    "sweep",
]
