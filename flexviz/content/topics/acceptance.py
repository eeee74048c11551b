"""Whether the result keeps stated limits, for which range that holds, and what it does not prove."""

from __future__ import annotations

from typing import Any

from flexviz.analysis.acceptance import NOT_PROVED, AcceptanceResult, AcceptanceScope, acceptance_scope, judge
from flexviz.content.blocks import Block, Callout, Cell, Items, Paragraph, Section, section, table
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register


def accepted(content: Story) -> AcceptanceResult | None:
    """The lines of the limits; None without limits or a result."""
    source = content.diagnosis or content.identification
    if content.limits is None or source is None:
        return None
    return judge(source.document(), content.limits, content.joints)


class Acceptance(Topic):
    """A row per requirement with figure and limit, the tested range, what is not proved."""

    name = "acceptance"
    title = "Acceptance"

    def section(self, story: Story) -> Section | None:
        found = accepted(story)
        return (
            None
            if found is None
            else section(self.title, *verified(found, acceptance_scope(story.measurements)))
        )

    def numbers(self, story: Story) -> Any:
        found = accepted(story)
        return None if found is None else found.to_dict()


register(Acceptance())


def verified(found: AcceptanceResult, scope: AcceptanceScope) -> list[Block]:
    """What was required and found, the tested range, what is not proved."""
    rows = [
        [
            Cell("pass" if line.passed else "fail", strong=not line.passed),
            line.joint or "all",
            line.what.text,
            line.found.text,
            line.required.text,
        ]
        for line in found.lines
    ]
    return [
        Callout(found.text, "good" if found.passed else "missing"),
        table(("", "joint", "requirement", "found", "required"), rows, (3,), fold=(2,)),
        Paragraph(scope.text),
        Items([one.fact.text for one in scope.joints]),
        Paragraph("This does not prove:"),
        Items([fact.text for fact in NOT_PROVED]),
    ]
