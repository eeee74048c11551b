"""What is wrong or odd with a recording, as facts; `str()` of one says it in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from flexviz.base.facts import Fact
from flexviz.data.logs import Fix, Proposal
from flexviz.robot.robot import Robot

Severity = Literal["wrong", "odd"]


@dataclass(frozen=True, eq=False)
class Issue:
    """Something in a recording that looks wrong or odd.

    Attributes:
        kind: of fault: a hypothesis or a mask of `flexviz.checks`, or what else is seen.
        severity: "wrong": the data contradict what is stated, and a set is written only if the user
            insists; "odd": it may be intended.
        joints: concerned; all of them where it concerns the whole recording.
        signal: "theta", "tau", "q", "theta_ref", "theta and tau", "payloads" or "robot".
        values: further facts by name; joints by name, SI units.
        fixes: changes of a mapping that would resolve it, where they are known.
        proposals: keys that would, for the user to decide.
        alike: what explains the data as well.
        slides: those of the joints that slide.
    """

    kind: str
    severity: Severity
    joints: tuple[str, ...]
    signal: str
    values: Mapping[str, Any] = field(default_factory=dict)
    fixes: tuple[Fix, ...] = ()
    proposals: tuple[Proposal, ...] = ()
    alike: Sequence[Issue] = ()
    slides: tuple[str, ...] = ()

    @property
    def message(self) -> str:
        """Its sentence, without signal and joints."""
        return Fact("issue", self.severity, self.joints, values={"issue": self}).text

    def __str__(self) -> str:
        return f"{self.signal} of {', '.join(self.joints)}: {self.message}"

    @property
    def remedies(self) -> tuple[Proposal, ...]:
        """Fixes and proposals, all as keys of the mapping."""
        fixes = (Proposal(("joints", fix.joint, fix.signal), fix.key, fix.value) for fix in self.fixes)
        return *fixes, *self.proposals


def with_sliding(issues: Sequence[Issue], robot: Robot) -> list[Issue]:
    """The issues with what is known of their joints: whether they slide."""
    sliding = {joint for joint, slides in zip(robot.joints, robot.prismatic, strict=True) if slides}
    if not sliding:
        return list(issues)
    return [replace(one, slides=tuple(joint for joint in one.joints if joint in sliding)) for one in issues]
