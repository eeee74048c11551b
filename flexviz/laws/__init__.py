"""The law of an effect through its data: the proof of a finding."""

from flexviz.laws.law_chart import law_chart, law_difference
from flexviz.laws.law_through_data import LawThroughData, laws_of, laws_through_data
from flexviz.laws.variables import VARIABLES, variable_of

__all__ = [
    "VARIABLES",
    "LawThroughData",
    "law_chart",
    "law_difference",
    "laws_of",
    "laws_through_data",
    "variable_of",
]
