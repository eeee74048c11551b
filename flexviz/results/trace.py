"""Entries for what a search tried: its moves, and decoys."""

from __future__ import annotations

from pydantic import Field

from flexviz.results.base import Nullable, ResultEntry


class MoveEntry(ResultEntry):
    """A move of the search: the decrease of its objective with its standard error [nats]."""

    kind: str
    added: list[str] = Field(default_factory=list)
    removed: list[str] = Field(default_factory=list)
    delta: Nullable
    error: Nullable
    accepted: bool
    resolution: str
    why: str = ""


class DecoysEntry(ResultEntry):
    """Candidates that cannot be right: how many of those tried were accepted."""

    accepted: int
    tried: int
