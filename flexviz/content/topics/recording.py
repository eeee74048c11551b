"""What the robot contradicts in its recording."""

from __future__ import annotations

from flexviz.content.blocks import Block, warning
from flexviz.content.results import ResultDocument
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register


class Contradictions(Topic):
    """Whether the recording is what it says; a report warns of it in its summary, the app in step Data."""

    name = "recording"

    def blocks(self, result: ResultDocument) -> list[Block]:
        return [warning(f"recording: {entry.message}") for entry in result.recording]

    def section(self, story: Story) -> None:
        return None


register(Contradictions())
