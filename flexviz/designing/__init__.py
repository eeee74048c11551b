"""Design of experiments: motions and payloads that show parameters, or a missing effect, best."""

from flexviz.designing.motion import Reached
from flexviz.designing.prediction import PredictedError, predict_errors
from flexviz.designing.run import Design, DesignedGroup, design
from flexviz.designing.settings import DesignSettings, LimitTable, settings_from
from flexviz.designing.static import StaticDesign, design_static, static_lines, write_static
from flexviz.designing.subject import Planned, subject_of
from flexviz.designing.writing import design_files, summary_lines, write_design

__all__ = [
    "Design",
    "DesignSettings",
    "DesignedGroup",
    "LimitTable",
    "Planned",
    "PredictedError",
    "Reached",
    "StaticDesign",
    "design",
    "design_files",
    "design_static",
    "predict_errors",
    "settings_from",
    "static_lines",
    "subject_of",
    "summary_lines",
    "write_design",
    "write_static",
]
