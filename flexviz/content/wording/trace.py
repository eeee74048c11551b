"""What a search tried, as text: accepted moves, the best refused ones, decoys."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from flexviz.base.spelling import listed, number, plural
from flexviz.content.records import Decoys, Move
from flexviz.content.wording.findings import effect_text_name, where_text
from flexviz.content.wording.merging import Families, text_names
from flexviz.content.wording.numbers import with_error

MOVES = {
    "add": "{added}{not_} added",
    "drop": "{removed}{not_} dropped",
    "swap": "{added}{not_} put in place of {removed}",
    "episode": "{added}{not_} added",
    "unknown": "{added}{not_} allowed for",
}  # kind of move -> in words
OTHER = "{kind} of {both}{not_} made"
TRACE_TITLE = "Why these effects: what was tried"


@dataclass(frozen=True)
class ToldMove:
    """A move in words, or accepted moves of one kind on several joints.

    Attributes:
        text: "Coulomb friction on joints 1 and 2 added".
        delta: decrease of the objective [nats]: "400"; of earlier versions with a standard error, "400 ± 12".
        accepted: whether the search made it.
        resolution: "coarse", "fine", or both.
        why: why it was refused.
    """

    text: str
    delta: str
    accepted: bool
    resolution: str
    why: str = ""

    @property
    def line(self) -> str:
        """The move on one line."""
        return f"{self.text}: {self.delta} nats" + (f" ({self.why})" if self.why else "")


def told_moves(
    trace: Iterable[Move],
    joints: Sequence[str] = (),
    families: Families | None = None,
    *,
    refused: int = 5,
) -> list[ToldMove]:
    """The accepted moves in order, those of one kind together, then the best refused ones.

    A refused move is left out where the same one was accepted at another time; of one that was refused
    several times the best trial counts.

    Args:
        trace: all moves, in order.
        joints: all joints of the robot.
        families: of those effects that stand for one, by their texts.
        refused: number of refused moves.
    """
    trace = list(trace)
    groups: dict[object, list[Move]] = {}
    for move in trace:
        if move.accepted:
            names = [tuple(text.partition(":")[0] for text in texts) for texts in (move.added, move.removed)]
            groups.setdefault((move.kind, *names), []).append(move)
    made = {_key(move) for move in trace if move.accepted}
    best: dict[object, Move] = {}
    for move in sorted(trace, key=_delta, reverse=True):
        if not move.accepted and _key(move) not in made:
            best.setdefault(_key(move), move)
    chosen = [[move] for move in list(best.values())[:refused]]
    return [_told(moves, joints, families) for moves in (*groups.values(), *chosen)]


def _key(move: Move) -> object:
    return move.kind, tuple(move.added), tuple(move.removed)


def _delta(move: Move) -> float:
    return -math.inf if math.isnan(move.delta) else move.delta


def _told(moves: Sequence[Move], joints: Sequence[str], families: Families | None) -> ToldMove:
    """Moves of one kind as one: the decreases add up, their errors in squares."""
    first = moves[0]
    added, removed = (
        _names(first.kind, [text for move in moves for text in texts(move)], joints, families)
        for texts in (lambda move: move.added, lambda move: move.removed)
    )
    both = listed([name for name in (added, removed) if name] or ["nothing"])
    made = "" if first.accepted else " not"
    words = MOVES.get(first.kind, OTHER)
    text = words.format(added=added, removed=removed, both=both, kind=first.kind, not_=made)
    delta, error = math.fsum(move.delta for move in moves), math.hypot(*(move.error for move in moves))
    shown = number(delta, 3) if error == 0 else " ± ".join(with_error(delta, error))
    resolutions = dict.fromkeys(move.resolution for move in moves)
    return ToldMove(text, shown, first.accepted, listed(list(resolutions)), str(first.why))


def _names(kind: str, texts: Sequence[str], joints: Sequence[str], families: Families | None) -> str:
    if not texts:
        return ""
    if kind == "unknown":
        places = [where_text(text.partition(":")[2] or None) or f" ({text})" for text in texts]
        return listed([f"an unknown torque{place}" for place in places])
    families = families if kind != "swap" else None  # often one member of a family for another
    unique = list(dict.fromkeys(texts))
    known = text_names(unique, joints, families) if joints else [effect_text_name(text) for text in unique]
    return listed(known)


def decoys_text(decoys: Decoys) -> str:
    """ "of 40 decoys none was accepted": how often the search took what cannot be right."""
    accepted = decoys.accepted
    found = "none was" if accepted == 0 else "1 was" if accepted == 1 else f"{accepted} were"
    return f"of {plural(decoys.tried, 'decoy')} {found} accepted"
