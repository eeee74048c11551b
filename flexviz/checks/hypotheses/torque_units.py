"""τ in another unit, on the other side of its gear, or by an unknown factor; of one joint or of all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.joint_fit import SMALLEST_SCALE
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS
from flexviz.data.logs import CURRENT, ColumnChange, Mapping, change_of, conversions


def resized(by: Array) -> Callable[[Reading], Reading]:
    """τ times (n,) or (groups, n)."""
    return lambda now: replace(now, size=now.size * by)


@hypothesis
def torque_units(case: Case) -> Iterator[Fault]:
    if case.now.free.all():  # the size of τ is not known
        return
    n = len(case.every)
    slopes = np.array([fit.slope for fit in case.comparison.fits(replace(case.now, free=np.ones(n, bool)))])
    known = [torque_changes(case.mapping, joint) for joint in case.mapping.names]
    for joints in case.groups_of_joints:
        own = {j: float(slopes[j]) for j in joints}
        for label in dict.fromkeys(label for j in joints for label in known[j]):
            if all(label in known[j] for j in joints):
                fixes = [known[j][label].fixes for j in joints]
                by = np.ones(n)
                by[list(joints)] = [known[j][label].factor for j in joints]
                prior = (len(fixes[0]) - 1) * np.log(LIMITS.rarer)
                values = {"slopes": own, "factors": {j: float(1 / abs(by[j])) for j in joints}}
                yield Fault(
                    "size", joints, "tau", resized(by), label, sum(fixes, ()), prior=prior, values=values
                )
        if any(slopes[j] <= SMALLEST_SCALE for j in joints):
            continue  # nothing of τ is the masses': it has no size
        # the mean of their slopes
        factor = float(np.exp(np.mean(np.log(slopes[list(joints)]))))
        unknown = float(np.log(LIMITS.mass_spread / LIMITS.unit_spread))
        gears = {j: case.mapping.joints[case.mapping.names[j]].ratio for j in joints}
        values = {"slopes": own, "stated_gears": gears}
        by = case.at(joints, 1.0 / factor)
        yield Fault("size", joints, "tau", resized(by), "any", prior=unknown, values=values)


@hypothesis
def of_one_log(case: Case) -> Iterator[Fault]:
    """All torques of one group in another unit, as where another program has logged them."""
    names = case.mapping.names
    if len(case.comparison.names) < 2 or case.now.free.all():
        return
    changes = [torque_changes(case.mapping, joint) for joint in names]
    for label in (label for label in changes[0] if all(label in own for own in changes)):
        for g, group in enumerate(case.comparison.names):
            if not case.comparison.alone(g).doubts_size:
                continue  # made small, what is hard to explain would count less
            by = case.of_group(g, np.array([own[label].factor for own in changes]))
            values = {"groups": (group,), "read_as": label}
            yield Fault("size", case.every, "tau", resized(by), label, values=values, groups=(g,))


def torque_changes(mapping: Mapping, joint: str) -> dict[str, ColumnChange]:
    """τ in other units, on the other side of the gear, or both: label -> change."""
    currents = CURRENT if mapping.joints[joint].torque_constant else ()
    single = conversions(mapping, joint, "tau", tuple(currents))
    units, sides = ([{}, *(one for one in single if key in one)] for key in ("unit", "side"))
    found = [
        change_of(mapping, joint, "tau", unit | side) for unit, side in product(units, sides) if unit | side
    ]
    return {str(change): change for change in found}
