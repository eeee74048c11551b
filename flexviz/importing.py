"""Logs in other formats. See `flexviz.data.importing`."""

from flexviz.data.importing import *
