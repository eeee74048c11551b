"""The samples of an import's groups, as masks look at them, and the groups without what they leave out."""

from __future__ import annotations

from collections.abc import Mapping as Named
from collections.abc import Sequence

from flexviz.checks import AllSamples, GroupSamples, Issue, kept, shortened
from flexviz.data.logs import AssembledGroup, Mapping
from flexviz.data.measurements import GroupTable
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
    return [
        shortened(group.table, kept(issues, group.entry.group, group.table.time + group.since))
        for group in groups
    ]
