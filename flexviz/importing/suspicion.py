"""What looks wrong in imported data, and what in the mapping would put it right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from flexviz.importing.mapping import Mapping, Signal


@dataclass(frozen=True)
class Fix:
    """A change of the mapping: `joints.<joint>.<signal>.<key> = value`."""

    joint: str
    signal: str
    key: str
    value: str | float | int


@dataclass(frozen=True)
class Suspicion:
    """Something that looks wrong.

    Attributes:
        kind: "unit", "sign", "zero", "swapped", "delay", "clock" or "unexplained".
        severity: "wrong": the data contradict the mapping; the set is not written unless the user insists.
            "odd": it may be so.
        joints: which; all of them where it concerns the whole log.
        signal: "theta", "tau", "q" or "theta_ref".
        message: one sentence with numbers.
        fixes: what would put it right, where that is known.
    """

    kind: Literal["unit", "sign", "zero", "swapped", "delay", "clock", "unexplained"]
    severity: Literal["wrong", "odd"]
    joints: tuple[str, ...]
    signal: str
    message: str
    fixes: tuple[Fix, ...] = ()

    def __str__(self) -> str:
        return f"{self.signal} of {', '.join(self.joints)}: {self.message}"


def fixed(mapping: Mapping, fixes: tuple[Fix, ...]) -> Mapping:
    """The mapping with these changes."""
    joints = dict(mapping.joints)
    for fix in fixes:
        entry = joints[fix.joint]
        signal: Signal = getattr(entry, fix.signal)
        changed = signal.model_copy(update={fix.key: fix.value})
        joints[fix.joint] = entry.model_copy(update={fix.signal: changed})
    return mapping.model_copy(update={"joints": joints})
