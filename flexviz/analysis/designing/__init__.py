"""Design of experiments: motions and payloads that show parameters, or a missing effect, best."""

from flexviz.analysis.designing.motion import Reached
from flexviz.analysis.designing.prediction import PredictedError, predict_errors
from flexviz.analysis.designing.run import Design, DesignedGroup, design
from flexviz.analysis.designing.settings import DesignSettings, LimitTable, settings_from
from flexviz.analysis.designing.static import StaticDesign, design_static, static_fact, write_static
from flexviz.analysis.designing.subject import Planned, subject_of
from flexviz.analysis.designing.writing import design_facts, design_files, write_design

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
    "design_facts",
    "design_files",
    "design_static",
    "predict_errors",
    "settings_from",
    "static_fact",
    "subject_of",
    "write_design",
    "write_static",
]
