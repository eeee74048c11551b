"""Diagnosis: is the model complete, and if not, what is missing and where."""

from flexviz.analysis.diagnosis.bandwidth_check import check_bandwidth
from flexviz.analysis.diagnosis.course import LEAST_SURE
from flexviz.analysis.diagnosis.criterion import Criterion, ModelScore, confidence, criterion_of, unexplained
from flexviz.analysis.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.analysis.diagnosis.curves import fit_free_curve
from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.pipeline import diagnose
from flexviz.analysis.diagnosis.prediction_errors import (
    BAND_HERTZ,
    PredictionErrors,
    TorqueOverTime,
    errors_along,
    prediction_errors,
    torque_over_time,
)
from flexviz.analysis.diagnosis.residual_location import joint_maps, locate_residual, maps_of
from flexviz.analysis.diagnosis.residuals import DIRECTED, DIRECTION_GAIN, SLOW, SlowResidual
from flexviz.analysis.diagnosis.result import Diagnosis, Evidence, Finding, Step
from flexviz.analysis.diagnosis.so_far import BestModel
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.content.results import BandwidthCheck, ParameterCurve

__all__ = [
    "BAND_HERTZ",
    "DIRECTED",
    "DIRECTION_GAIN",
    "LEAST_SURE",
    "SLOW",
    "THRESHOLDS",
    "BandwidthCheck",
    "BestModel",
    "Criterion",
    "Diagnosis",
    "Evidence",
    "Finding",
    "Fit",
    "FitContext",
    "ModelScore",
    "ParameterCurve",
    "PredictionErrors",
    "SlowResidual",
    "Step",
    "TorqueOverTime",
    "check_bandwidth",
    "confidence",
    "criterion_of",
    "diagnose",
    "errors_along",
    "fit_free_curve",
    "joint_maps",
    "locate_residual",
    "maps_of",
    "prediction_errors",
    "torque_over_time",
    "unexplained",
    "why_no_curve",
    "with_free_curve",
]
