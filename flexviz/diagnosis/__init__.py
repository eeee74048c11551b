"""Diagnosis: is the model complete, and if not, what is missing and where."""

from flexviz.diagnosis.diagnose import Progress, diagnose
from flexviz.diagnosis.result import Diagnosis, Finding, ResidualLocation, Step, Tie

__all__ = ["Diagnosis", "Finding", "Progress", "ResidualLocation", "Step", "Tie", "diagnose"]
