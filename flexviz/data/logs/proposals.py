"""Keys of a mapping that a check proposes and only the user sets."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from flexviz.base import toml


@dataclass(frozen=True)
class Proposal:
    """A key of the mapping that would mend an issue."""

    # ("joints", joint, signal), ("logs", group), ("model",), ("time",), or () for the top of the file
    place: tuple[str, ...]
    key: str
    value: Any

    @property
    def text(self) -> str:
        """The key as it is written."""
        return f"{self.key} = {toml.value_text(self.value)}"

    def __str__(self) -> str:
        if len(self.place) == 3:
            return f"{self.text} in {self.place[2]} of [joints.{self.place[1]}]"
        if len(self.place) == 1:
            return f"{self.text} in [{self.place[0]}]"
        return f'{self.text} for log "{self.place[1]}"' if self.place else self.text


def proposed(document: dict[str, Any], proposals: Iterable[Proposal]) -> dict[str, Any]:
    """The content of a mapping file, in place, with the proposed keys."""
    for proposal in proposals:
        table = document
        if proposal.place[:1] == ("logs",):
            table = next(log for log in document["logs"] if log["group"] == proposal.place[1])
        elif len(proposal.place) == 1:
            table = document.setdefault(proposal.place[0], {})
        elif proposal.place:
            table = document["joints"][proposal.place[1]][proposal.place[2]]
        table[proposal.key] = proposal.value
    return document
