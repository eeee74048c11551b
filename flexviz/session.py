"""An analysis with its history, saved and restored. See `flexviz.content.session`."""

from flexviz.content.session import *
