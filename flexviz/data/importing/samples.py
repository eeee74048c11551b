"""The samples of an import's groups, as masks look at them, and the groups without what they leave out."""

from __future__ import annotations

from collections.abc import Mapping as Named
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.checks import AllSamples, GroupSamples, Issue
from flexviz.data.logs import SHORTEST, AssembledGroup, Mapping
from flexviz.data.measurements import OPTIONAL_SIGNALS, GroupTable
from flexviz.data.noise import Channel
from flexviz.robot.robot import PayloadBody, Robot


def samples_of_logs(
    mapping: Mapping,
    robot: Robot,
    payloads: Named[str, Sequence[PayloadBody]],
    groups: Sequence[AssembledGroup],
) -> AllSamples:
    """What the logs have of every group, in the part that is used."""
    every = (
        GroupSamples(
            group.entry.group,
            channels(group),
            group.table.time + group.since,
            group.table.theta,
            group.table.tau,
            payloads[group.table.payload],
            group.entry.leave_out,
        )
        for group in groups
    )
    return AllSamples(robot, tuple(every), tuple(mapping.model.no_torque))


def channels(group: AssembledGroup) -> tuple[Channel, ...]:
    """All signals as the log has them."""
    found = []
    for (joint, signal), trace in group.traces.items():
        used = group.uses(trace.time)
        incomplete = None if trace.incomplete is None else trace.incomplete[used]
        time, values = trace.time[used] - group.origin, trace.values[used] / trace.scale
        found.append(Channel(signal, joint, time, values, abs(trace.scale), incomplete, trace.rows[used]))
    return tuple(found)


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
