"""All checks of an import: of the samples first, then of what the mapping says of them."""

from __future__ import annotations

from collections.abc import Mapping as Named
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.checks import Issue, check_groups, check_references, with_sliding
from flexviz.data.importing.samples import SPOILT, check_samples, without_stretches
from flexviz.data.logs import AssembledGroup, Mapping, Proposal
from flexviz.data.measurements import (
    Segment,
    TorqueRun,
    pieces,
    seen_limits,
    silent_torques,
)
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
    if mapping.drive is not None:  # without a torque, only samples can be wrong
        return check_samples(mapping, robot, payloads, groups)
    silent = check_silent(mapping, robot, payloads, groups)
    samples = check_samples(mapping, robot, payloads, groups)
    spoilt = [issue for issue in samples if issue.kind in SPOILT]
    if any(issue.proposals for issue in spoilt):
        return spoilt
    tables = [(payloads[table.payload], table) for table in without_stretches(groups, samples)]
    found = check_groups(mapping, robot, tables, guessed)
    unit = {
        joint for issue in found if issue.kind == "unit" and "theta" in issue.signal for joint in issue.joints
    }
    if spoilt := [issue for issue in spoilt if not unit & set(issue.joints)]:
        return spoilt
    found += [issue for issue in samples if issue.kind not in SPOILT]
    quiet = {joint for issue in silent for joint in issue.joints}
    told = [issue for issue in found if issue.kind != "unexplained" or not quiet.issuperset(issue.joints)]
    others = (
        *check_references(mapping, [group.table for group in groups]),
        *check_saturated(mapping, groups),
    )
    return with_sliding([*told, *silent, *others], robot)


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


def check_silent(
    mapping: Mapping,
    robot: Robot,
    payloads: Named[str, Sequence[PayloadBody]],
    groups: Sequence[AssembledGroup],
) -> list[Issue]:
    """Torques that are no signal although their joints move: one issue, with the key that leaves them out."""
    runs = [
        TorqueRun(payloads[table.payload], table.time, table.theta, table.tau)
        for table in (group.table for group in groups)
    ]
    stated = mapping.model.no_torque
    found = {j: what for j, what in silent_torques(robot, runs).items() if j not in stated}
    if not found or len(found) + len(stated) == robot.n:
        return []
    key = Proposal(("model",), "no_torque", [*stated, *found])
    return [Issue("no_torque", "odd", tuple(found), "tau", {"what": found}, proposals=(key,))]


def check_saturated(mapping: Mapping, groups: Sequence[AssembledGroup]) -> list[Issue]:
    """Torques that stand at a limit while their joints move: one issue per joint."""
    segments = []
    for table in (group.table for group in groups):
        step = float(np.median(np.diff(table.time)))
        segments += [Segment(table.time[p], table.theta[p], table.tau[p], step) for p in pieces(table.time)]
    found = []
    for one in seen_limits(segments):
        values = {name: getattr(one, name) for name in ("lower", "upper", "tolerance", "rows")}
        found.append(Issue("saturated", "odd", (mapping.names[one.joint],), "tau", values))
    return found
