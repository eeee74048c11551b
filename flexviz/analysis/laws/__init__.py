"""The law of an effect through its data: the proof of a finding."""

from flexviz.analysis.laws.law_chart import law_chart, law_difference
from flexviz.analysis.laws.law_through_data import LawThroughData, laws_of, laws_through_data
from flexviz.analysis.laws.variables import VARIABLES, variable_of

__all__ = [
    "VARIABLES",
    "LawThroughData",
    "law_chart",
    "law_difference",
    "laws_of",
    "laws_through_data",
    "variable_of",
]
