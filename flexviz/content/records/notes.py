"""Verdicts, grades and notes of a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass as record

from flexviz.base.fields import RECORD, Number

Verdict = Literal["missing", "nothing-missing", "unknown", "not-searched"]
"""On a model; "not-searched": the diagnosis was stopped before it tried anything."""
LimitReason = Literal["noise", "filter", "resolution", "tolerance"]
Grade = Literal["yes", "weak", "no"]
NoteKind = Literal[
    "model-error",
    "pulses",
    "unexplained",
    "changing",
    "drowned",
    "place",
    "unbiased",
    "free-curve",
    "stopgap",
    "bandwidth",
    "standstill",
    "filtered",
    "explained",
    "noise",
    "other",
]


@dataclass(frozen=True)
class Note:
    """A remark on a diagnosis in one sentence.

    Kinds: "model-error" (effects were judged despite a model error), "pulses" (the error occurs at
    reversals), "unexplained" (remaining error), "changing" (the size of an effect changes with time),
    "drowned" (noise larger than the torque),
    "place" (where an unknown law acts), "unbiased" (parameters that it does not bias), "free-curve" (error
    that a free curve would absorb), "stopgap" (free curves in the model), "bandwidth" (values that change
    with the observer bandwidth), "standstill" (joints whose rest is judged apart), "explained" (share of
    each joint's torque that the model explains), "noise" (share of it that is noise), "other".
    """

    kind: NoteKind
    text: str


@record(frozen=True, config=RECORD)
class DetectionLimit:
    """Down to what "nothing is missing" holds: a smaller effect would not have been seen.

    Attributes:
        share: of the spread of the recorded torque; of several joints the largest.
        because: what hides smaller ones: the sensors' "noise", a "filter" that the recording has passed, the
            "resolution" of the sensors, or the "tolerance" of the model's own equations.
    """

    share: Annotated[Number, Field(ge=0.0)]
    because: LimitReason
