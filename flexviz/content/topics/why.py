"""Why these effects: the moves that the search accepted, and the best that it refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.content import wording
from flexviz.content.blocks import LISTED, Block, Cell, Paragraph, Section, section, table
from flexviz.content.results import ResultDocument
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.topics.verdict import joints_of

DECOYS = "candidates that cannot be right and compete in the same search, to estimate its false rate"
CAPTION = "Moves of the search, and the best that it refused: decrease of its objective"


class Why(Topic):
    """The trace of the search."""

    name = "why"
    title = wording.TRACE_TITLE

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        return why_blocks(result, joints_of(result))

    def section(self, story: Story) -> Section | None:
        found = [] if story.diagnosis is None else why_blocks(story.diagnosis, story.joints, story.families)
        return section(self.title, *told) if (told := list(found)) else None


register(Why())


def why_blocks(
    result: ResultDocument | Diagnosis, joints: Sequence[str], families: Mapping[str, str] | None = None
) -> Iterator[Block]:
    """A row per move; `families` are those of effects that earlier diagnoses added."""
    known = wording.added_families(result) | dict(families or {})
    moves = wording.told_moves(result.trace, joints, known, refused=LISTED)
    rows = [
        [
            Cell(move.text, strong=move.accepted),
            move.delta,
            move.resolution,
            "accepted" if move.accepted else move.why or "refused",
        ]
        for move in moves
    ]
    if rows:
        yield table(("move", "decrease [nats]", "resolution", ""), rows, (1,), CAPTION, fold=(0, 3))
    if result.decoys is not None:
        yield Paragraph(f"{wording.capitalised(wording.decoys_text(result.decoys))}: {DECOYS}.")
