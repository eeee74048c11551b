"""All checks of an import: of the samples first, then of what the mapping says of them."""

from __future__ import annotations

from collections.abc import Mapping as Named
from collections.abc import Sequence

from flexviz.importing.assembling import AssembledGroup
from flexviz.importing.mapping import Issue, Mapping
from flexviz.importing.plausibility import check_groups
from flexviz.importing.samples import SPOILT, check_samples, without_stretches
from flexviz.robot import PayloadBody, Robot


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
    return [*found, *(issue for issue in samples if issue.kind not in SPOILT)]
