"""Issues of imported data, and the changes of the mapping that would resolve them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from flexviz.importing.mapping import Mapping, SignalColumn


@dataclass(frozen=True)
class Fix:
    """A change of the mapping: `joints.<joint>.<signal>.<key> = value`."""

    joint: str
    signal: str
    key: str
    value: str | float | int


@dataclass(frozen=True)
class Issue:
    """Something in the data that looks wrong or odd.

    Attributes:
        kind: of the fault.
        severity: "wrong": the data contradict the mapping, the set is not written unless the user insists;
            "odd": it may be intended.
        joints: concerned ones; all of them where it concerns the whole log.
        signal: "theta", "tau", "q" or "theta_ref".
        message: one sentence with numbers.
        fixes: changes that would resolve it, where they are known.
    """

    kind: Literal["unit", "sign", "zero", "swapped", "delay", "clock", "unexplained"]
    severity: Literal["wrong", "odd"]
    joints: tuple[str, ...]
    signal: str
    message: str
    fixes: tuple[Fix, ...] = ()

    def __str__(self) -> str:
        return f"{self.signal} of {', '.join(self.joints)}: {self.message}"


def with_fixes(mapping: Mapping, fixes: tuple[Fix, ...]) -> Mapping:
    """The mapping with these changes."""
    joints = dict(mapping.joints)
    for fix in fixes:
        entry = joints[fix.joint]
        signal: SignalColumn = getattr(entry, fix.signal)
        changed = signal.model_copy(update={fix.key: fix.value})
        joints[fix.joint] = entry.model_copy(update={fix.signal: changed})
    return mapping.model_copy(update={"joints": joints})
