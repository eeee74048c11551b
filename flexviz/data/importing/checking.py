"""All checks of an import: of the samples first, then of what the mapping says of them."""

from __future__ import annotations

from collections.abc import Mapping as Named
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.checks import Issue, check_groups, other_samples, spoilt_samples
from flexviz.data.importing.samples import samples_of_logs, without_stretches
from flexviz.data.logs import AssembledGroup, Mapping
from flexviz.robot.robot import PayloadBody, Robot


def check_all(
    mapping: Mapping,
    robot: Robot,
    payloads: Named[str, Sequence[PayloadBody]],
    groups: Sequence[AssembledGroup],
    guessed: bool = False,
) -> list[Issue]:
    """What is wrong with the samples, then with what the mapping says of them.

    Samples that jump contradict anything; but in a wrong unit, smooth motion may look like jumps.
    """
    # what holds against a clamp is no motion of the robot's masses
    groups = _without_torques(mapping, [group for group in groups if group.entry.kind == "motion"])
    logged = samples_of_logs(mapping, robot, payloads, groups)
    spoilt = spoilt_samples(logged)
    if mapping.drive is not None:  # nothing else is known without a torque
        return spoilt
    if any(issue.proposals for issue in spoilt):
        return spoilt
    samples = [] if spoilt else other_samples(logged)
    tables = [(payloads[table.payload], table) for table in without_stretches(groups, samples)]
    found = check_groups(mapping, robot, tables, guessed)
    unit = {
        joint for issue in found if issue.kind == "unit" and "theta" in issue.signal for joint in issue.joints
    }
    if spoilt := [issue for issue in spoilt if not unit & set(issue.joints)]:
        return spoilt
    quiet = {joint for issue in samples if issue.kind == "no_torque" for joint in issue.joints}
    found = [issue for issue in found if issue.kind != "unexplained" or not quiet.issuperset(issue.joints)]
    return [*found, *samples]


def _without_torques(mapping: Mapping, groups: Sequence[AssembledGroup]) -> list[AssembledGroup]:
    """The groups without the torques that the mapping states to be no signal."""
    silent = mapping.model.no_torque
    kept = np.array([joint not in silent for joint in mapping.names])
    return [
        replace(
            group,
            table=replace(group.table, tau=np.where(kept, group.table.tau, 0.0)),
            traces={at: trace for at, trace in group.traces.items() if at[0] not in silent or at[1] != "tau"},
        )
        for group in groups
    ]
