"""The law of an effect through its data: the proof of a finding."""

from flexviz.analysis.laws.law_through_data import LawThroughData, laws_of, laws_through_data
from flexviz.analysis.laws.variables import VARIABLES, variable_of

__all__ = [
    "VARIABLES",
    "LawThroughData",
    "laws_of",
    "laws_through_data",
    "variable_of",
]
