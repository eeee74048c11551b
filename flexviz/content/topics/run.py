"""How an identification ran, and what its numbers are worth."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flexviz.content.blocks import Block, Paragraph
from flexviz.content.results import ResultDocument, assessment
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register


class FitRun(Topic):
    """Groups, observer, iterations; a report has them among what reproduces it."""

    name = "run"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        if result.verdict is not None:
            return
        yield Paragraph(f"{result.set}: {result.message}")
        if result.observer is not None and result.seconds is not None:
            how = f"{result.iterations} iterations in {result.seconds:.2f} s"
            yield Paragraph(f"{how}; observer {result.observer.name}, {result.observer.tuning}")
        held_out = f"; validated on {', '.join(result.validation_groups)}" if result.validation_groups else ""
        yield Paragraph(f"fitted on {', '.join(result.groups or ())}{held_out}")
        if math.isfinite(result.condition_number):
            yield Paragraph(f"condition number {result.condition_number:.3g}")

    def section(self, story: Story) -> None:
        return None


class Assessment(Topic):
    """What is good, what is weak, what to do and to record next."""

    name = "assessment"
    title = "What this is worth"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        said = assessment(result) if result.verdict is None else ""
        if said:
            yield Paragraph(said)

    def section(self, story: Story) -> None:
        return None  # its advice is among the warnings of the summary


register(FitRun())
register(Assessment())
