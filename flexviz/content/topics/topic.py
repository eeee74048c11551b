"""A topic of content: what is said about one thing, in blocks that every medium draws."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, ClassVar

from flexviz.content.blocks import Block, Section
from flexviz.content.results import ResultDocument
from flexviz.content.topics.story import Story

REPORT = [
    "summary",
    "acceptance",
    "staircase",
    "torque",
    "added",
    "why",
    "parameters",
    "link-encoders",
    "errors",
    "where",
    "next_experiments",
    "bandwidth",
    "recording",
    "run",
    "notes",
    "assessment",
    "reproduce",
]
"""Names of topics in the order of a report; the app draws these by its steps' own controls."""
FIRST = ("summary", "added", "why")
"""Where one result is printed: what is found stands above how the error fell."""


class Topic:
    """What results say about one thing. A new topic is one file in this folder with `register(Its())`.

    `blocks` is enough: terminal, Python and notebook print them, a Rerun recording keeps them, a report has
    them as a section, the app below its findings. What has more to tell of a session overrides `section`.
    """

    name: ClassVar[str]
    """Unique; its key in a report's JSON."""
    title: ClassVar[str] = ""
    """Of its section."""

    def blocks(self, result: ResultDocument) -> Iterable[Block]:
        """What an identification or a diagnosis says of it."""
        return ()

    def section(self, story: Story) -> Section | None:
        """What a session's report says of it; None: nothing."""
        found = [] if story.document is None else list(self.blocks(story.document))
        return Section(self.title, found) if found else None

    def numbers(self, story: Story) -> Any:
        """What the JSON of a report holds under its name; None: nothing."""
        return None


TOPICS: dict[str, Topic] = {}


def register(topic: Topic) -> None:
    """Make a topic known to every medium."""
    TOPICS[topic.name] = topic


def ordered(names: Sequence[str] = REPORT) -> list[Topic]:
    """All topics in reading order; those without a place come before the last."""

    def place(topic: Topic) -> float:
        return names.index(topic.name) if topic.name in names else len(names) - 1.5

    return sorted(TOPICS.values(), key=place)


def blocks_of(result: ResultDocument) -> Iterator[Block]:
    """All that an identification or a diagnosis says."""
    for topic in ordered([*FIRST, *(name for name in REPORT if name not in FIRST)]):
        yield from topic.blocks(result)


def more_blocks(result: Any) -> list[Block]:
    """What topics say of a result that no step of the app draws by its own controls."""
    shown = [topic for topic in ordered() if topic.name not in REPORT]
    document = result.document() if result is not None and shown else None
    return [] if document is None else [block for topic in shown for block in topic.blocks(document)]
