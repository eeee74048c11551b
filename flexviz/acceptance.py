"""Judging results against limits. See `flexviz.analysis.acceptance`."""

from flexviz.analysis.acceptance import *
