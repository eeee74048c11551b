"""Fits in the band of the motion, each joint weighted by what its model leaves."""

from flexviz.analysis.motion.fit import MotionContext, MotionFit
from flexviz.analysis.motion.one_by_one import one_by_one
from flexviz.analysis.motion.robust import Residuals, deviations, huber
from flexviz.analysis.motion.samples import Phase, Phases, phases
from flexviz.analysis.motion.thresholds import MOTION
from flexviz.analysis.motion.usual import Fitted, Known, plain_model, scale, usual_model

__all__ = [
    "MOTION",
    "Fitted",
    "Known",
    "MotionContext",
    "MotionFit",
    "Phase",
    "Phases",
    "Residuals",
    "deviations",
    "huber",
    "one_by_one",
    "phases",
    "plain_model",
    "scale",
    "usual_model",
]
