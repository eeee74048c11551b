"""What is wrong with the samples of a recording: what, where, why, and what would help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices

Kind = Literal[
    "messages",  # two kinds of message on one topic, of which one jumps
    "wrapped",  # a counter or an angle that overflows
    "dropped",  # one number stands for a missing value
    "outliers",  # samples that jump away and come back
    "jumps",  # positions that jump for no known reason
    "repeated",  # values that last several rows
    "stale",  # a value that stands still while the joint moves
    "constant",  # a column that never changes
    "held",  # an arm at rest with a torque that cannot hold it
    "contact",  # a torque from outside for a while
    "filtered",  # a log that was low-passed before it was written
]


@dataclass(frozen=True)
class Remedy:
    """A key of an import's mapping that mends a finding: of a signal, of a log, or of the whole mapping."""

    key: str
    value: float | bool | tuple[tuple[float, float], ...]
    of: Literal["signal", "log", "mapping"] = "signal"


@dataclass(frozen=True)
class SampleFinding:
    """Something in the samples of one signal of one joint.

    Attributes:
        kind: see `Kind`.
        signal: "theta" or "tau".
        joint: its name.
        stretches: first and last sample of each stretch concerned, counted from 0; at most `SHOWN`.
        seconds: when these begin and end [s].
        count: samples concerned in all.
        found, cause, expected: the parts of a message.
        remedy: what mends it in an import, or None.
    """

    kind: Kind
    signal: str
    joint: str
    stretches: tuple[tuple[int, int], ...]
    seconds: tuple[tuple[float, float], ...]
    count: int
    found: str
    cause: str
    expected: str
    remedy: Remedy | None = None

    @property
    def column(self) -> str:
        """Its name in a set's table."""
        return f"{self.signal}_{self.joint}"


SHOWN = 50  # stretches that a finding keeps


@dataclass(frozen=True, eq=False)
class Channel:
    """One recorded signal of one joint.

    Attributes:
        signal: "theta" or "tau".
        joint: its name.
        time: (N,) [s], increasing.
        values: (N,) in the unit of the column.
        size: one such unit in SI, positive.
        incomplete: (N,) whether the sample's row lacks another signal; None: none does.
    """

    signal: str
    joint: str
    time: Array
    values: Array
    size: float = 1.0
    incomplete: Bools | None = None

    def finding(
        self, kind: Kind, samples: Indices, texts: tuple[str, str, str], remedy: Remedy | None = None
    ) -> SampleFinding:
        """A finding at these samples (m,), ascending; `texts`: what is found, its cause, what is expected."""
        stretches = runs(samples)
        seconds = tuple((float(self.time[i]), float(self.time[j])) for i, j in stretches[:SHOWN])
        where = tuple(stretches[:SHOWN])
        return SampleFinding(kind, self.signal, self.joint, where, seconds, len(samples), *texts, remedy)


def runs(samples: Indices) -> list[tuple[int, int]]:
    """First and last of each run of consecutive numbers."""
    if not len(samples):
        return []
    cuts = np.flatnonzero(np.diff(samples) > 1)
    first = samples[np.concatenate([[0], cuts + 1])]
    last = samples[np.concatenate([cuts, [len(samples) - 1]])]
    return [(int(i), int(j)) for i, j in zip(first, last, strict=True)]


def worst_of_columns(found: Sequence[SampleFinding]) -> tuple[SampleFinding, ...]:
    """Of each column the first finding, the column with the most samples concerned first."""
    columns = {finding.column: finding for finding in reversed(found)}
    return tuple(sorted(columns.values(), key=lambda finding: -finding.count))
