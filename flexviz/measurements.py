"""Measurement sets. See `flexviz.data.measurements`."""

from flexviz.data.measurements import *
