"""Diagnosis: is the model complete, and if not, what is missing and where."""

from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.diagnosis.curves import fit_free_curve
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.pipeline import diagnose
from flexviz.diagnosis.prediction_errors import (
    BAND_HERTZ,
    PredictionErrors,
    TorqueOverTime,
    errors_along,
    prediction_errors,
    torque_over_time,
)
from flexviz.diagnosis.residual_location import locate_residual, maps_of
from flexviz.diagnosis.residuals import DIRECTED, DIRECTION_GAIN
from flexviz.diagnosis.result import Diagnosis, Evidence, Finding, Step
from flexviz.diagnosis.so_far import BestModel
from flexviz.results import BandwidthCheck, ParameterCurve

__all__ = [
    "BAND_HERTZ",
    "DIRECTED",
    "DIRECTION_GAIN",
    "BandwidthCheck",
    "BestModel",
    "Diagnosis",
    "Evidence",
    "Finding",
    "Fit",
    "FitContext",
    "ParameterCurve",
    "PredictionErrors",
    "Step",
    "TorqueOverTime",
    "check_bandwidth",
    "diagnose",
    "errors_along",
    "fit_free_curve",
    "locate_residual",
    "maps_of",
    "prediction_errors",
    "torque_over_time",
    "why_no_curve",
    "with_free_curve",
]
