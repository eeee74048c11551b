"""Samples that no motion explains: jumps, dropped and stale values, brakes, contacts, limits, filters.

A kind is a function of all groups that yields issues, registered by `mask`, in a file of its own in
`flexviz/checks/masks`. Kinds that spoil a signal come first: nothing else is concluded from it.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from flexviz.base.arrays import Array, Bools, Indices
from flexviz.base.facts import Remedy
from flexviz.checks.issues import Issue, Severity, with_sliding
from flexviz.data.logs import NEEDED, Proposal
from flexviz.data.measurements import Segment, pieces
from flexviz.data.noise import Channel
from flexviz.robot.robot import PayloadBody, Robot

SHOWN = 50  # stretches that a finding keeps
LISTED = 3  # stretches that an issue lists
MOVES = 0.02  # of its largest speed, from which a joint counts as moving


@dataclass(frozen=True, eq=False)
class GroupSamples:
    """One group as it was recorded.

    Attributes:
        name: of the group.
        channels: the signals of all joints, each on its own clock.
        time: (N,) [s] after the log's first sample.
        theta, tau: (N, n) at `time` [rad], [Nm].
        bodies: its payload.
        leave_out: stretches that are left out already [s].
    """

    name: str
    channels: tuple[Channel, ...]
    time: Array
    theta: Array
    tau: Array
    bodies: Sequence[PayloadBody] = ()
    leave_out: Sequence[Sequence[float]] = ()

    @property
    def needed(self) -> tuple[Channel, ...]:
        """Those of θ and τ."""
        return tuple(channel for channel in self.channels if channel.signal in NEEDED)

    @cached_property
    def segments(self) -> list[Segment]:
        """Its stretches without a gap."""
        step = float(np.median(np.diff(self.time)))
        return [Segment(self.time[p], self.theta[p], self.tau[p], step) for p in pieces(self.time)]

    def moves(self, channel: Channel) -> Bools:
        """Where a channel's joint moves, (N,); for a position where any does: stale values hide its own."""
        moves = np.zeros(len(channel.time), dtype=bool)
        for joint, (time, speed) in self._speeds.items():
            if channel.signal == "theta" or joint == channel.joint:
                moves |= np.interp(channel.time, time, speed) > MOVES * np.max(speed)
        return moves

    @cached_property
    def _speeds(self) -> dict[str, tuple[Array, Array]]:
        """Joint -> time [s] and |θ̇|, up to a unit."""
        positions = (c for c in self.channels if c.signal == "theta" and len(c.time) > 1)
        return {c.joint: (c.time, np.abs(np.gradient(c.values, c.time))) for c in positions}


@dataclass(frozen=True, eq=False)
class AllSamples:
    """All groups of a set or an import; `no_torque`: joints whose torque is stated to be no signal."""

    robot: Robot
    groups: tuple[GroupSamples, ...]
    no_torque: tuple[str, ...] = ()

    @property
    def segments(self) -> list[Segment]:
        """Stretches without a gap of all groups."""
        return [segment for group in self.groups for segment in group.segments]


@dataclass(frozen=True)
class SampleFinding:
    """What is wrong with samples of one signal of one joint in one group.

    Attributes:
        kind: see `flexviz.checks.masks`.
        signal: "theta" or "tau".
        joint: its name.
        seconds: first and last instant of each stretch concerned [s], at most `SHOWN`.
        rows: the same as rows of the log, from 1.
        count: samples concerned in all.
        values: numbers of its kind, see `flexviz.content.wording.sample_kinds`.
        remedy: what mends it in an import, or None.
    """

    kind: str
    signal: str
    joint: str
    seconds: tuple[tuple[float, float], ...]
    rows: tuple[tuple[int, int], ...]
    count: int
    values: Mapping[str, Any] = field(default_factory=dict)
    remedy: Remedy | None = None

    @staticmethod
    def at(
        channel: Channel, samples: Indices, kind: str, remedy: Remedy | None = None, **values: Any
    ) -> SampleFinding:
        """A finding at these samples (m,) of a channel, ascending."""
        stretches = runs(samples)[:SHOWN]
        seconds = tuple((float(channel.time[i]), float(channel.time[j])) for i, j in stretches)
        rows = tuple((channel.row(begin), channel.row(end)) for begin, end in seconds)
        count = len(samples)
        return SampleFinding(kind, channel.signal, channel.joint, seconds, rows, count, values, remedy)


Found = list[tuple[GroupSamples, SampleFinding]]
OfGroup = Callable[[GroupSamples, Robot], Iterable[SampleFinding]]
Mask = Callable[[AllSamples], Iterable[Issue]]
MASKS: dict[str, Mask] = {}
SPOILING: dict[str, Mask] = {}
SPOILT = ("messages", "wrapped", "dropped", "outliers", "jumps")  # kinds of those


def mask(function: Mask) -> Mask:
    """Register a kind of fault of samples."""
    MASKS[function.__name__] = function
    return function


def mask_of_groups(*, spoils: bool = False) -> Callable[[OfGroup], OfGroup]:
    """Register a kind that is looked for in each group by itself."""

    def register(function: OfGroup) -> OfGroup:
        def every(samples: AllSamples) -> list[Issue]:
            found = [(g, one) for g in samples.groups for one in function(g, samples.robot)]
            return issues_of(samples, found)

        (SPOILING if spoils else MASKS)[function.__name__] = every
        return function

    return register


def spoilt_samples(samples: AllSamples) -> list[Issue]:
    """Issues of signals of which nothing can be concluded."""
    found = [issue for kind in SPOILING.values() for issue in kind(samples)]
    return with_sliding(found, samples.robot)


def other_samples(samples: AllSamples, but: Container[str] = ()) -> list[Issue]:
    """Issues of samples that are wrong although the signals are a robot's; `but`: without some masks."""
    found = [issue for name, kind in MASKS.items() if name not in but for issue in kind(samples)]
    return with_sliding(found, samples.robot)


def kept(issues: Sequence[Issue], group: str, time: Array) -> Bools:
    """Which instants (N,) [s] after a log's first sample the issues do not propose to leave out."""
    used = np.ones(len(time), dtype=bool)
    for key in (key for issue in issues for key in issue.proposals if key.place == ("logs", group)):
        if key.key == "from":
            used &= time >= key.value
        elif key.key == "to":
            used &= time <= key.value
        for first, last in key.value if key.key == "leave_out" else ():
            used &= (time < first) | (time > last)
    return used


def issues_of(samples: AllSamples, found: Found) -> list[Issue]:
    """One issue per kind and signal: that with the most samples is described."""
    kinds: dict[tuple[str, str], Found] = {}
    for group, one in found:
        kinds.setdefault((one.kind, one.signal), []).append((group, one))
    return [_issue(samples, alike) for alike in kinds.values()]


def _issue(samples: AllSamples, found: Found) -> Issue:
    group, worst = max(found, key=lambda item: item[1].count)
    joints = tuple(j for j in samples.robot.joints if any(one.joint == j for _, one in found))
    stretches = zip(worst.rows[:LISTED], worst.seconds, strict=False)
    values = {
        "group": group.name,
        "joint": worst.joint,
        "stretches": tuple((*rows, *seconds) for rows, seconds in stretches),
        "more": len(worst.rows) > LISTED,
        "count": worst.count,
        "also_in": tuple(sorted({other.name for other, _ in found} - {group.name})),
        **worst.values,
    }
    severity: Severity = "wrong" if worst.kind in SPOILT else "odd"
    proposals = tuple({str(proposal): proposal for proposal in _proposals(found)}.values())
    return Issue(worst.kind, severity, joints, worst.signal, values, proposals=proposals)


def _proposals(found: Found) -> Iterator[Proposal]:
    """Keys of a mapping that would mend these findings."""
    stretches: dict[str, list[tuple[GroupSamples, Remedy]]] = {}
    for group, finding in found:
        remedy = finding.remedy
        if remedy is None:
            continue
        if remedy.of == "mapping":
            yield Proposal((), remedy.key, remedy.value)
        elif remedy.of == "signal":
            for joint, signal in ((finding.joint, finding.signal), *finding.values.get("same_bus", ())):
                yield Proposal(("joints", joint, signal), remedy.key, _plain(remedy.value))
        else:
            stretches.setdefault(group.name, []).append((group, remedy))
    for name, remedies in stretches.items():
        keys = {remedy.key for _, remedy in remedies}
        if len(keys) == 1 and keys < {"from", "to", "drop_jumps"}:
            values = [remedy.value for _, remedy in remedies]
            (key,) = keys
            yield Proposal(("logs", name), key, min(values) if key == "to" else max(values))
            continue
        group = remedies[0][0]
        spans = sorted(span for _, remedy in remedies for span in _spans(remedy, group))
        yield Proposal(("logs", name), "leave_out", _united([*group.leave_out, *spans]))


def _plain(value: object) -> object:
    """A whole number without a decimal point."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _spans(remedy: Remedy, group: GroupSamples) -> list[tuple[float, float]]:
    end = round(float(group.time[-1]) + 0.001, 3)
    if isinstance(remedy.value, tuple):
        return list(remedy.value)
    return [(0.0, float(remedy.value))] if remedy.key == "from" else [(float(remedy.value), end)]


def _united(spans: Sequence[Sequence[float]]) -> list[list[float]]:
    """Stretches that overlap become one."""
    united: list[list[float]] = []
    for first, last in sorted(map(tuple, spans)):
        if united and first <= united[-1][1]:
            united[-1][1] = max(united[-1][1], last)
        else:
            united.append([first, last])
    return united


def runs(samples: Indices) -> list[tuple[int, int]]:
    """First and last of each run of consecutive numbers."""
    if not len(samples):
        return []
    cuts = np.flatnonzero(np.diff(samples) > 1)
    first = samples[np.concatenate([[0], cuts + 1])]
    last = samples[np.concatenate([cuts, [len(samples) - 1]])]
    return [(int(i), int(j)) for i, j in zip(first, last, strict=True)]
