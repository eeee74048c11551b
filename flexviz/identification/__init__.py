"""Identification: parameters with uncertainty from measurements."""

from flexviz.identification.bandwidth_sweep import SweepResult, sweep
from flexviz.identification.estimator import Estimate, Estimator
from flexviz.identification.link_side_check import link_side_checks
from flexviz.identification.messages import saturated_torques, torques_without_signal
from flexviz.identification.pipeline import identify
from flexviz.identification.plots import IdentificationPlots, laws_figure
from flexviz.identification.preview import ObservedResidual, ResidualPreview
from flexviz.identification.result import Identification, ResidualSeries
from flexviz.identification.settings import FitOptions, FitSettings, fit_settings
from flexviz.identification.summary import combinations, parameter_estimates

__all__ = [
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
    "combinations",
    "fit_settings",
    "identify",
    "laws_figure",
    "link_side_checks",
    "parameter_estimates",
    "saturated_torques",
    "sweep",
    "torques_without_signal",
]
