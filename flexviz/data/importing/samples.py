"""What the samples of logs contain that no sensor of a moving robot writes, as issues with proposed keys."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from collections.abc import Mapping as Named
from dataclasses import replace

import numpy as np

from flexviz.base.arrays import Bools
from flexviz.checks import Issue, Severity
from flexviz.data.logs import NEEDED, SHORTEST, AssembledGroup, Mapping, Proposal
from flexviz.data.measurements import OPTIONAL_SIGNALS, GroupTable, Segment, likely_limits, pieces
from flexviz.data.noise import (
    Channel,
    GroupSamples,
    Remedy,
    SampleFinding,
    check_jumps,
    check_outside,
    check_repeats,
    filtered_before_writing,
    has_sign_bit,
)
from flexviz.robot.robot import PayloadBody, Robot

SPOILT = ("messages", "wrapped", "dropped", "outliers", "jumps")  # nothing is concluded from such signals
LISTED = 3  # stretches that a message lists
MOVES = 0.02  # of its largest speed, from which a joint counts as moving

Found = list[tuple[AssembledGroup, SampleFinding]]


def check_samples(
    mapping: Mapping,
    robot: Robot,
    payloads: Named[str, Sequence[PayloadBody]],
    groups: Sequence[AssembledGroup],
) -> list[Issue]:
    """Jumps, repeated values, torques from outside, filters: one issue per kind and signal."""
    found: Found = []
    for group in groups:
        own = [
            finding for channel in channels(group) for finding in _of_channel(channel, group, mapping, robot)
        ]
        if mapping.drive is None and not any(finding.kind in SPOILT for finding in own):
            time = group.table.time + group.since
            recording = GroupSamples(time, group.table.theta, group.table.tau, payloads[group.table.payload])
            own += check_outside(recording, robot)
        found += [(group, finding) for finding in own]
    kinds = dict.fromkeys((finding.kind, finding.signal) for _, finding in found)
    issues = [
        _issue(mapping, [item for item in found if (item[1].kind, item[1].signal) == kind]) for kind in kinds
    ]
    if mapping.drive is not None or any(issue.kind in SPOILT for issue in issues):
        return issues
    return [*issues, *_filtered(mapping, groups)]


def channels(group: AssembledGroup) -> Iterator[Channel]:
    """θ and τ of all joints as the log has them, in the part that is used."""
    for (joint, signal), trace in group.traces.items():
        if signal in NEEDED:
            used = group.uses(trace.time)
            yield Channel(
                signal, joint, trace.time[used] - group.origin, trace.values[used] / trace.scale,
                abs(trace.scale), None if trace.incomplete is None else trace.incomplete[used],
            )  # fmt: skip


def _of_channel(
    channel: Channel, group: AssembledGroup, mapping: Mapping, robot: Robot
) -> list[SampleFinding]:
    j = mapping.names.index(channel.joint)
    jumps = check_jumps(channel, 2 * float(likely_limits(robot)[1][j]), robot.prismatic[j])
    if jumps or mapping.drive is not None:  # a servo holds still near its goal while others move
        return jumps
    return check_repeats(channel, _moves(channel, group))


def _moves(channel: Channel, group: AssembledGroup) -> Bools:
    """Where the joint moves, (N,); for a position where any does: stale values hide its own motion."""
    joints = {joint for joint, _ in group.traces} if channel.signal == "theta" else {channel.joint}
    moves = np.zeros(len(channel.time), dtype=bool)
    for joint in joints:
        trace = group.traces[joint, "theta"]
        if len(trace.time) > 1:
            speed = np.abs(np.gradient(trace.values, trace.time))
            at = np.interp(channel.time + group.origin, trace.time, speed)
            moves |= at > MOVES * np.max(speed)
    return moves


def _issue(mapping: Mapping, found: Found) -> Issue:
    """One issue of findings of one kind and signal: that with the most samples is described."""
    group, worst = max(found, key=lambda item: item[1].count)
    joints = tuple(j for j in mapping.names if any(finding.joint == j for _, finding in found))
    also = sorted({other.entry.group for other, _ in found} - {group.entry.group})
    values = {
        "group": group.entry.group,
        "joint": worst.joint,
        "stretches": _where(group, worst),
        "more": len(worst.stretches) > LISTED,
        "count": worst.count,
        "also_in": tuple(also),
        "found": worst.found,
        "cause": worst.cause,
        "expected": worst.expected,
    }
    severity: Severity = "wrong" if worst.kind in SPOILT else "odd"
    proposals = tuple({str(proposal): proposal for proposal in _proposals(mapping, found)}.values())
    return Issue(worst.kind, severity, joints, worst.signal, values, proposals=proposals)


def _where(group: AssembledGroup, finding: SampleFinding) -> tuple[tuple[int, int, float, float], ...]:
    """First and last row of the log, and begin and end [s] after its first sample, of a few stretches."""
    trace = group.traces[finding.joint, finding.signal]

    def row(seconds: float) -> int:
        return int(trace.rows[np.searchsorted(trace.time, seconds + group.origin - 1e-9)]) + 1

    return tuple((row(begin), row(end), begin, end) for begin, end in finding.seconds[:LISTED])


def _proposals(mapping: Mapping, found: Found) -> Iterator[Proposal]:
    """Keys of the mapping that would mend these findings."""
    stretches: dict[str, list[tuple[AssembledGroup, Remedy]]] = {}
    for group, finding in found:
        remedy = finding.remedy
        if remedy is None:
            continue
        if remedy.of == "mapping":
            yield Proposal((), remedy.key, remedy.value)
        elif remedy.of == "signal":
            yield Proposal(("joints", finding.joint, finding.signal), remedy.key, _plain(remedy.value))
            if remedy.key == "sign_bit":
                yield from _same_bus(group, finding, int(remedy.value))  # type: ignore[arg-type]
        else:
            stretches.setdefault(group.entry.group, []).append((group, remedy))
    for name, remedies in stretches.items():
        keys = {remedy.key for _, remedy in remedies}
        if len(keys) == 1 and keys < {"from", "to", "drop_jumps"}:
            values = [remedy.value for _, remedy in remedies]
            (key,) = keys
            yield Proposal(("logs", name), key, min(values) if key == "to" else max(values))
            continue
        group = remedies[0][0]
        spans = sorted(span for _, remedy in remedies for span in _spans(remedy, group))
        yield Proposal(("logs", name), "leave_out", _united([*group.entry.leave_out, *spans]))


def _same_bus(group: AssembledGroup, finding: SampleFinding, bit: int) -> Iterator[Proposal]:
    """The sign bit of other joints and of the reference, which do not jump or are not looked at."""
    signals = {finding.signal, "theta_ref"} if finding.signal == "theta" else {finding.signal}
    for (joint, signal), trace in group.traces.items():
        other = signal in signals and (joint, signal) != (finding.joint, finding.signal)
        if other and has_sign_bit(trace.values / trace.scale, bit):
            yield Proposal(("joints", joint, signal), "sign_bit", bit)


def _plain(value: float | bool | tuple[tuple[float, float], ...]) -> object:
    """A whole number without a decimal point."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _spans(remedy: Remedy, group: AssembledGroup) -> list[tuple[float, float]]:
    end = round(float(group.table.time[-1]) + group.since + 0.001, 3)
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


def without_stretches(groups: Sequence[AssembledGroup], issues: Sequence[Issue]) -> list[GroupTable]:
    """The tables without the stretches that the issues propose to leave out."""
    keys: dict[str, dict[str, object]] = {}
    for place, key, value in ((p.place, p.key, p.value) for issue in issues for p in issue.proposals):
        if place[:1] == ("logs",):
            keys.setdefault(place[1], {})[{"from": "start", "to": "stop"}.get(key, key)] = value
    tables = []
    for group in groups:
        entry, table = group.entry.model_copy(update=keys.get(group.entry.group, {})), group.table
        used = entry.uses(table.time + group.since)
        if np.count_nonzero(used) < SHORTEST or used.all():
            tables.append(table)
            continue
        columns = {name: getattr(table, name) for name in ("time", "theta", "tau", *OPTIONAL_SIGNALS)}
        tables.append(replace(table, **{name: x[used] for name, x in columns.items() if x is not None}))
    return tables


def _filtered(mapping: Mapping, groups: Sequence[AssembledGroup]) -> list[Issue]:
    """Torques that were low-passed before they were written."""
    segments = []
    for table in (group.table for group in groups):
        step = float(np.median(np.diff(table.time)))
        segments += [Segment(table.time[p], table.theta[p], table.tau[p], step) for p in pieces(table.time)]
    log = filtered_before_writing(segments)
    if log.hertz is None or not log.certain:
        return []
    joints = tuple(j for j, hertz in zip(mapping.names, log.tau, strict=True) if np.isfinite(hertz))
    return [Issue("filtered", "odd", joints, "tau", {"hertz": log.hertz})]
