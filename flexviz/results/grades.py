"""The words a result is graded with, and its notes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["missing", "nothing-missing", "unknown"]
Grade = Literal["yes", "weak", "no"]
NoteKind = Literal["model-error", "pulses", "unexplained", "free-curve", "bandwidth", "other"]


@dataclass(frozen=True)
class Note:
    """What a reader of a diagnosis should know beside the verdict: a kind and a sentence.

    The kinds: "model-error" (effects were judged beside a model error), "pulses" (the error is that of
    reversals), "unexplained" (what stays), "free-curve" (what a free curve would absorb), "bandwidth" (what
    moves with the observer's bandwidth), "other".
    """

    kind: NoteKind
    text: str
