"""What a search tried: its moves, and decoys."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Real


@dataclass(frozen=True, config=RECORD)
class Move:
    """One move that the search tried.

    Attributes:
        kind: "add", "drop", "swap", "episode" (a contact) or "unknown" (an unknown torque).
        added, removed: effects as on the command line: "coulomb_friction:joint1".
        delta: decrease of the objective [nats].
        error: 0; in documents of earlier versions, the standard error of `delta` [nats].
        resolution: "coarse" or "fine".
        why: why it was not accepted, in words; "" if it was.
    """

    kind: str
    added: tuple[str, ...]
    removed: tuple[str, ...]
    delta: Real
    error: Real
    accepted: bool
    resolution: str
    why: str = ""


@dataclass(frozen=True, config=RECORD)
class Decoys:
    """Candidates that cannot be right: how many of those tried were accepted."""

    accepted: int
    tried: int
