"""Simulated motion and sets. See `flexviz.model.simulation`."""

from flexviz.model.simulation import *
