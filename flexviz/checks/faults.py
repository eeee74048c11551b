"""What may be wrong with a recording: one thing, and the reading of the columns if it is so.

A kind of fault is a function that yields faults, registered by `hypothesis`, in a file of its own in
`flexviz/checks/hypotheses`. What it yields shares the kind's probability.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS
from flexviz.data.logs import Fix, Proposal
from flexviz.data.logs import Mapping as LogMapping

if TYPE_CHECKING:
    from flexviz.checks.rigid import Comparison


@dataclass(frozen=True, eq=False)
class Fault:
    """One thing that may be wrong.

    Attributes:
        kind: of fault, see `flexviz.content.wording`.
        joints: that are concerned.
        signal: whose columns are concerned: "theta", "tau", "theta and tau", "payloads", "robot".
        change: the reading with it, of the reading without.
        name: distinguishes the faults of a kind on the same joints and signal.
        groups: that are concerned, by number; none: all of them.
        fixes, proposals: keys of the mapping that undo it.
        prior: logarithm of the probability, against the others of its kind.
        open: logarithm of the precision to which the data find what it does not know, over that before.
        values: further facts.
    """

    kind: str
    joints: tuple[int, ...]
    signal: str
    change: Callable[[Reading], Reading]
    name: str = ""
    fixes: tuple[Fix, ...] = ()
    proposals: tuple[Proposal, ...] = ()
    prior: float = 0.0
    open: float = 0.0
    values: Mapping[str, Any] = field(default_factory=dict)
    groups: tuple[int, ...] = ()

    @property
    def place(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Where it is: joints and groups."""
        return self.joints, self.groups

    @property
    def key(self) -> tuple[str, tuple[int, ...], str, str]:
        """What distinguishes it from others."""
        return self.kind, self.joints, self.signal, self.name

    def excludes(self, other: Fault) -> bool:
        """Whether both cannot be wrong: they are of one kind and signal, at a common place."""
        same = self.kind == other.kind and self.signal == other.signal
        meet = not (self.groups and other.groups) or bool(set(self.groups) & set(other.groups))
        return same and meet and bool(set(self.joints) & set(other.joints))


@dataclass(frozen=True, eq=False)
class Case:
    """What a hypothesis is asked about.

    Attributes:
        mapping: what is stated.
        comparison: the motion.
        now: the reading to which a fault is added.
        payloads_known: whether the groups' payloads are stated.
    """

    mapping: LogMapping
    comparison: Comparison
    now: Reading
    payloads_known: bool

    @property
    def every(self) -> tuple[int, ...]:
        """All joints."""
        return tuple(range(self.comparison.robot.n))

    @property
    def groups_of_joints(self) -> list[tuple[int, ...]]:
        """All joints together, and each of several."""
        return [self.every, *((j,) for j in self.every if len(self.every) > 1)]

    def at(self, joints: Sequence[int], value: float | Array, otherwise: float = 1.0) -> Array:
        """(n,) a value at these joints."""
        return np.where(np.isin(self.every, joints), value, otherwise)

    def of_group(self, group: int, value: float | Array, otherwise: float = 1.0) -> Array:
        """(groups, n) a value, or one per joint, in one group."""
        here = np.arange(len(self.comparison.names))[:, None] == group
        return np.where(here, value, np.full(len(self.every), otherwise))


Hypothesis = Callable[[Case], Iterator[Fault]]
HYPOTHESES: dict[str, Hypothesis] = {}


def hypothesis(function: Hypothesis) -> Hypothesis:
    """Register a function that yields the faults of a kind."""
    HYPOTHESES[f"{function.__module__}.{function.__name__}"] = function
    return function


def possible_faults(case: Case) -> list[Fault]:
    """Everything that may be wrong apart from what the reading changes already."""
    if case.now.magnitude:  # the masses' own sign would agree with any of them
        return []
    found = []
    for kind in HYPOTHESES.values():
        own = list(kind(case))
        weights = np.exp([fault.prior for fault in own])
        for fault, weight in zip(own, weights, strict=True):
            found.append(
                replace(fault, prior=float(np.log(LIMITS.fault * weight / np.sum(weights))) + fault.open)
            )
    return found


def together(faults: Sequence[Fault], start: Reading) -> Reading:
    """The reading with several faults."""
    for fault in faults:
        start = fault.change(start)
    return start
