"""What results say, topic by topic: one file each, which registers itself, in blocks for every medium."""

import pkgutil
from importlib import import_module

from flexviz.content.topics.acceptance import verified
from flexviz.content.topics.data import SIMULATED, set_blocks, set_rows
from flexviz.content.topics.findings import finding_panel, heading
from flexviz.content.topics.parameters import check_blocks, parameter_panel
from flexviz.content.topics.staircase import group_rows
from flexviz.content.topics.story import Story, diagnosed_session, gather, shown_time
from flexviz.content.topics.topic import TOPICS, Topic, blocks_of, more_blocks, ordered, register
from flexviz.content.topics.verdict import sentence, verdict_panel, warnings
from flexviz.content.topics.where import map_panel
from flexviz.content.topics.why import why_blocks

for found in pkgutil.iter_modules(__path__):
    import_module(f"{__name__}.{found.name}")
