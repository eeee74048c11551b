"""Recordings for the Rerun viewer. See `flexviz.outlets.recording`."""

from flexviz.outlets.recording import *
