"""What contradicts a recording, in documents."""

from __future__ import annotations

from typing import Any, Literal

from pydantic.dataclasses import dataclass as record

from flexviz.base.fields import RECORD


@record(frozen=True, config=RECORD)
class RecordingEntry:
    """Something in a recording that its robot contradicts.

    Attributes:
        kind: of fault.
        severity: "wrong" or "odd".
        joints, signal: concerned.
        values: numbers by name [SI].
        message: all of it in a sentence.
    """

    kind: str
    severity: Literal["wrong", "odd"]
    joints: tuple[str, ...]
    signal: str
    values: dict[str, Any]
    message: str
