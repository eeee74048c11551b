"""Reports of a session. See `flexviz.outlets.report`."""

from flexviz.outlets.report import *
