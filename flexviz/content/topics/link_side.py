"""What link encoders show of the stiffness, against the motor side."""

from __future__ import annotations

from flexviz.analysis.identification import Identification
from flexviz.content.blocks import Block, Cell, table
from flexviz.content.results import ResultDocument
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import estimate_words


class LinkEncoders(Topic):
    """A comparison with what no fit has seen; empty without link encoders."""

    name = "link-encoders"
    title = "Link encoders"

    def blocks(self, result: ResultDocument) -> list[Block]:
        return link_side_blocks(result)


register(LinkEncoders())


def link_side_blocks(result: ResultDocument | Identification) -> list[Block]:
    """The stiffness by the motor side and by the link encoder, one row per joint."""
    parameters = result.all_parameters if isinstance(result, ResultDocument) else result.parameters
    motor = {p.joint: p for p in parameters if p.name == "stiffness"}
    rows = [
        [one.joint, estimate_words(p), p.identifiable, Cell(one.text, strong=not one.agrees)]
        for one in result.link_side
        if (p := motor.get(one.joint)) is not None
    ]
    head = ("joint", "motor side ± 95 %", "identifiable", "link encoder (95 % interval)")
    caption = "Stiffness against the link encoders, which no fit has seen"
    return [table(head, rows, (), caption, fold=(0, 3))] if rows else []
