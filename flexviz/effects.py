"""Effects, and what user-defined ones derive from. See `flexviz.model.effects`."""

from flexviz.model.effects import *
