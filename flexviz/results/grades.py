"""Verdicts, grades and notes of a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["missing", "nothing-missing", "unknown"]
Grade = Literal["yes", "weak", "no"]
NoteKind = Literal["model-error", "pulses", "unexplained", "free-curve", "bandwidth", "other"]


@dataclass(frozen=True)
class Note:
    """A remark on a diagnosis in one sentence.

    Kinds: "model-error" (effects were judged despite a model error), "pulses" (the error occurs at
    reversals), "unexplained" (remaining error), "free-curve" (error that a free curve would absorb),
    "bandwidth" (values that change with the observer bandwidth), "other".
    """

    kind: NoteKind
    text: str
