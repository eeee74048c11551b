"""Many sets and studies. See `flexviz.outlets.batch`."""

from flexviz.outlets.batch import *
