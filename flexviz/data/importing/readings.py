"""Other readings of the columns: units, signs, zeros, order, mounting, gravity and payloads may be wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, permutations, product
from typing import Literal

import numpy as np

from flexviz.data.importing.column_names import CURRENT
from flexviz.data.importing.comparison import Comparison, Reading
from flexviz.data.importing.cross_checks import GEARS, ColumnChange, change_of, conversions, theta_changes
from flexviz.data.importing.mapping import Fix, IssueKind, Mapping
from flexviz.data.importing.thresholds import LIMITS
from flexviz.robot.mounting import DIRECTIONS, gravity_text

WRIST = 3  # last joints, of which neighbours may be coupled
TRIED_GEARS = 12  # between the smallest and the largest, of θ that no unit explains
SCALE_HALVINGS = 6  # of the ratio of two of them, to 1 % of the scale
SMALL_ARM = 4  # joints, of which every order is tried
ARM = 7  # joints, of which all pairs and triples are tried


@dataclass(frozen=True, eq=False)
class Change:
    """One thing that may be wrong: a further reading, what undoes it, and how likely it is beforehand."""

    kind: IssueKind | Literal["size"]
    reading: Reading
    joints: tuple[int, ...]  # that are concerned
    signals: str
    reason: str  # for "with {reason} …"
    fixes: tuple[Fix, ...] = ()
    prior: float = 0.0  # logarithm of the probability


def changes(mapping: Mapping, comparison: Comparison, now: Reading, payloads_known: bool) -> list[Change]:
    """Everything that may be wrong apart from what `now` changes; those of a kind share its probability."""
    if now.magnitude:  # the masses' own sign would agree with any of them
        return []
    sizes = [
        signs(mapping, now),
        theta_units(mapping, comparison, now),
        zeros(mapping, comparison, now),
        orders(mapping, comparison, now),
        mountings(now, mapping),
        gravity_parts(comparison, now, mapping),
        magnitudes(comparison, now, mapping),
        payloads(comparison, now, mapping) if payloads_known else iter(()),
        couplings(mapping, now),
    ]
    found = []
    for kind in map(list, sizes):
        weights = np.array([np.exp(change.prior) for change in kind])
        for change, weight in zip(kind, weights, strict=True):
            found.append(replace(change, prior=float(np.log(LIMITS.fault * weight / np.sum(weights)))))
    return found


def signs(mapping: Mapping, now: Reading) -> Iterator[Change]:
    """τ, θ, or both with the opposite sign on one joint or all; τ more often than θ."""
    names = mapping.names
    every = tuple(range(len(names)))
    groups = [(j,) for j in every] + ([every] if len(names) > 1 else [])
    for joints in groups:
        minus = np.where(np.isin(every, joints), -1.0, 1.0)
        theta = tuple(Fix(names[j], "theta", "sign", -mapping.joints[names[j]].theta.sign) for j in joints)
        tau = tuple(Fix(names[j], "tau", "sign", -mapping.joints[names[j]].tau.sign) for j in joints)
        turned = replace(now, factor=now.factor * minus, zero=now.zero * minus)
        yield Change("sign", replace(now, sign=now.sign * minus), joints, "tau", in_words(tau), tau)
        yield Change("sign", turned, joints, "theta", in_words(theta), theta, np.log(LIMITS.rarer))
        both = replace(turned, sign=now.sign * minus)
        reason = "opposite signs of theta and tau"
        yield Change("sign", both, joints, "theta and tau", reason, theta + tau, np.log(LIMITS.rarer))


def in_words(fixes: tuple[Fix, ...]) -> str:
    values = {fix.value for fix in fixes}
    return f"sign = {values.pop()}" if len(values) == 1 else "the opposite sign"


def theta_units(mapping: Mapping, comparison: Comparison, now: Reading) -> Iterator[Change]:
    """θ in another unit or before its gear, on one joint or on all that can be so."""
    names = mapping.names
    by_label: dict[str, dict[int, ColumnChange]] = {}
    for j, joint in enumerate(names):
        for change in theta_changes(mapping, joint):
            by_label.setdefault(str(change), {})[j] = change
    by_q = comparison.by_q * comparison.beyond(now)
    for j in map(int, np.flatnonzero(by_q)):  # where a unit or the gear has that factor, it is the one
        ratios = [abs(change[j].factor * by_q[j]) for change in by_label.values() if j in change]
        if any(1 / LIMITS.agrees < ratio < LIMITS.agrees for ratio in ratios):
            by_q[j] = 0.0
    if len(joints := tuple(int(j) for j in np.flatnonzero(by_q))):
        factor = now.factor.copy()
        factor[list(joints)] /= np.abs(comparison.by_q * now.factor)[list(joints)]
        yield Change("unit", replace(now, factor=factor), joints, "theta", "the range of q")
    far = tuple(int(j) for j in np.flatnonzero(comparison.beyond(now) & (comparison.by_q == 0.0)))
    if far:
        yield unknown_scale(comparison, now, far)
    unused = [j for j, joint in enumerate(names) if gear_unused(mapping, joint)]
    if unused:
        ratios = np.array(
            [mapping.joints[joint].ratio if j in unused else 1.0 for j, joint in enumerate(names)]
        )
        fixes = tuple(Fix(names[j], signal, "side", "motor") for j in unused for signal in ("theta", "tau"))
        reading = replace(now, factor=now.factor / ratios, size=ratios)
        yield Change(
            "unit", reading, tuple(unused), "theta and tau", 'side = "motor"', fixes, np.log(1 / LIMITS.rarer)
        )
    for label, members in by_label.items():
        for group in ([members] if len(members) > 1 else []) + [{j: c} for j, c in members.items()]:
            factor = now.factor.copy()
            for j, change in group.items():
                factor[j] *= change.factor
            reading = replace(now, factor=factor)
            # a joint that moved so little that nobody would have recorded it is no better explanation
            span = comparison.span[list(now.theta_order)] * np.abs(factor)
            if any(c.factor > 1.0 and comparison.beyond(reading)[j] for j, c in group.items()) or all(
                span[j] < LIMITS.smallest_motion for j in group
            ):
                continue
            fixes = tuple(fix for change in group.values() for fix in change.fixes)
            yield Change("unit", reading, tuple(group), "theta", label, fixes)


def unknown_scale(comparison: Comparison, now: Reading, joints: tuple[int, ...]) -> Change:
    """θ of joints that leave their range in no known unit: the scales that explain the torques best.

    It may be the motor's angle before an unknown gear, or be in per cent of the joint's range.
    """

    def scaled(reading: Reading, one: Sequence[int], by: float) -> Reading:
        factor = reading.factor.copy()
        factor[list(one)] *= by
        return replace(reading, factor=factor)

    step = float((GEARS[1] / GEARS[0]) ** (1 / (TRIED_GEARS - 1)))
    tried = [scaled(now, joints, 1 / gear) for gear in np.geomspace(*GEARS, TRIED_GEARS)]
    best = max(tried, key=comparison.score)
    for _ in range(SCALE_HALVINGS):
        step = np.sqrt(step)
        for one in (joints, *((j,) for j in joints if len(joints) > 1)):
            best = max((best, *(scaled(best, one, by) for by in (step, 1 / step))), key=comparison.score)
    # a scale of its own on each joint, found to this ratio
    prior = -len(joints) * np.log(np.log(GEARS[1] / GEARS[0]) / np.log(step))
    return Change("unit", best, joints, "range", "an unknown unit or gear", (), float(prior))


def gear_unused(mapping: Mapping, joint: str) -> bool:
    """Whether a joint's gear is stated and neither θ nor τ is said to be before it."""
    columns = mapping.joints[joint]
    return abs(columns.ratio) != 1.0 and columns.theta.side == columns.tau.side == "joint"


def zeros(mapping: Mapping, comparison: Comparison, now: Reading) -> Iterator[Change]:
    """θ of a revolute joint a quarter or half turn further, within its limits."""
    robot = comparison.robot
    recorded = np.concatenate(comparison.q)[:, list(now.theta_order)]
    for j, quarter in product(np.flatnonzero(~robot.prismatic), (1, -1, 2)):
        zero = now.zero.copy()
        zero[j] += quarter * np.pi / 2
        q = recorded[:, j] * now.factor[j]
        limits = robot.lower_limit[j] - LIMITS.zero, robot.upper_limit[j] + LIMITS.zero
        inside = [np.min(x) > limits[0] and np.max(x) < limits[1] for x in (q + now.zero[j], q + zero[j])]
        if inside[0] and not inside[1]:
            continue
        joint = mapping.names[j]
        offset = round(mapping.joints[joint].theta.offset + float(zero[j]), 6)
        fix = Fix(joint, "theta", "offset", offset)
        yield Change("zero", replace(now, zero=zero), (int(j),), "theta", f"offset = {offset:g} rad", (fix,))


def orders(mapping: Mapping, comparison: Comparison, now: Reading) -> Iterator[Change]:
    """Columns of several joints exchanged: τ alone, or with θ.

    Every order of few joints; of more ones exchanged pairs, three in a circle, all shifted by some, reversed,
    and in alphabetical order, as joint states often come. Of more joints than an arm has, only those that the
    masses explain badly are exchanged: the triples of a humanoid's 29 joints alone are 7,308 orders.
    """
    n, names = len(mapping.names), mapping.names
    same = suspects = tuple(range(n))
    whole = True
    if n > ARM:
        poor = np.array([fit.share < LIMITS.explained for fit in comparison.fits(now)])
        suspects, whole = tuple(np.flatnonzero(poor).tolist()), 2 * np.count_nonzero(poor) > n
    if n <= SMALL_ARM:
        tried = set(permutations(same))
    else:
        tried = set[tuple[int, ...]]()
        if whole:
            tried |= {same[k:] + same[:k] for k in range(1, n)} | {same[::-1]}
            alphabetical = tuple(int(i) for i in np.argsort(names))
            tried |= {alphabetical, tuple(int(i) for i in np.argsort(alphabetical))}
        for pair in combinations(suspects, 2):
            tried.add(moved(same, pair))
        for triple in combinations(suspects, 3):
            tried |= {moved(same, triple), moved(same, triple[::-1])}
    for order in sorted(tried - {same}):
        changed = tuple(j for j in same if order[j] != j)
        columns = ", ".join(names[j] for j in order)
        reason = (
            f"the columns of {names[changed[0]]} and {names[changed[1]]} exchanged"
            if len(changed) == 2
            else f"the columns read in the order {columns}"
        )
        tau = tuple(now.tau_order[k] for k in order)
        theta = tuple(now.theta_order[k] for k in order)
        yield Change("order", replace(now, tau_order=tau), changed, "tau", reason)
        yield Change(
            "order", replace(now, tau_order=tau, theta_order=theta), changed, "theta and tau", reason
        )


def moved(order: tuple[int, ...], places: Sequence[int]) -> tuple[int, ...]:
    """The order with these places moved round."""
    result = list(order)
    for here, there in zip(places, (*places[1:], places[0]), strict=True):
        result[here] = order[there]
    return tuple(result)


def mountings(now: Reading, mapping: Mapping) -> Iterator[Change]:
    """The base on a wall, on its side or under a ceiling."""
    every = tuple(range(len(mapping.names)))
    for down in DIRECTIONS.values():
        if down != now.down:
            yield Change("mounting", replace(now, down=down), every, "robot", gravity_text(down))


def gravity_parts(comparison: Comparison, now: Reading, mapping: Mapping) -> Iterator[Change]:
    """τ without the torque of gravity, that of payloads left in or out, and nothing but gravity."""
    every = tuple(range(len(mapping.names)))
    if now.gravity and now.motion:
        none = replace(now, gravity=False, load=False)
        yield Change("gravity", none, every, "tau", "no torque of gravity in it")
        if any(comparison.bodies):
            unloaded = replace(now, gravity=False)
            yield Change("gravity", unloaded, every, "tau", "no gravity but the payload's in it")
        yield Change("gravity", replace(now, motion=False), every, "tau", "nothing but gravity in it")


def magnitudes(comparison: Comparison, now: Reading, mapping: Mapping) -> Iterator[Change]:
    """τ without its sign, as some drives log a current: of all joints, where none is ever negative."""
    every = tuple(range(len(mapping.names)))
    if comparison.one_sided.all():
        yield Change("magnitude", replace(now, magnitude=True), every, "tau", "the sign that it lacks")


def payloads(comparison: Comparison, now: Reading, mapping: Mapping) -> Iterator[Change]:
    """The payloads of two groups exchanged."""
    every = tuple(range(len(mapping.names)))
    start = now.bodies or tuple(range(len(comparison.bodies)))
    seen = set()
    for one, other in combinations(range(len(start)), 2):
        bodies = [comparison.bodies[start[k]] for k in (one, other)]
        if bodies[0] is bodies[1] or list(bodies[0]) == list(bodies[1]):
            continue
        exchanged = list(start)
        exchanged[one], exchanged[other] = start[other], start[one]
        if tuple(exchanged) not in seen:
            seen.add(tuple(exchanged))
            reason = f"the payloads of {comparison.names[one]} and {comparison.names[other]} exchanged"
            yield Change("payload", replace(now, bodies=tuple(exchanged)), every, "payloads", reason)


def couplings(mapping: Mapping, now: Reading) -> Iterator[Change]:
    """Neighbouring wrist joints of which one is turned by both motors: τ, or θ and τ, are the motors'."""
    if now.drive is not None:
        return
    wrist = range(len(mapping.names))[-WRIST:]
    for pair, turned, ratio, theta_too in product(pairwise(wrist), (0, 1), (1.0, -1.0), (False, True)):
        drive = np.eye(len(mapping.names))
        drive[pair[turned], pair[1 - turned]] = ratio
        joints = ", ".join(f'"{mapping.names[j]}"' for j in pair)
        matrix = drive[np.ix_(pair, pair)].astype(int).tolist()
        signals = "theta and tau" if theta_too else "tau"
        reason = f'coupling = {{ joints = [{joints}], matrix = {matrix} }} and side = "motor" of {signals}'
        coupled = replace(now, drive=drive, theta_too=theta_too)
        yield Change("coupling", coupled, pair, "tau", reason)
        if not theta_too:  # τ was converted to the joints already: only friction is the motors'
            yield Change("coupling", replace(coupled, converted=True), pair, "tau", reason)


def sizes(mapping: Mapping, comparison: Comparison, now: Reading) -> Iterator[Change]:
    """τ in another unit, on the other side of its gear, or by an unknown factor; of one joint or of all."""
    names = mapping.names
    every = tuple(range(len(names)))
    slopes = np.array([fit.slope for fit in comparison.fits(replace(now, free=np.ones(len(names), bool)))])
    known = [torque_changes(mapping, joint) for joint in names]
    for joints in [every, *((j,) for j in every if len(names) > 1)]:
        for label in dict.fromkeys(label for j in joints for label in known[j]):
            if all(label in known[j] for j in joints):
                size, fixes = now.size.copy(), [known[j][label].fixes for j in joints]
                size[list(joints)] = [known[j][label].factor for j in joints]
                prior = (len(fixes[0]) - 1) * np.log(LIMITS.rarer)
                yield Change("size", replace(now, size=size), joints, "tau", label, sum(fixes, ()), prior)
        # the mean of their slopes
        factor = float(np.exp(np.mean(np.log(slopes[list(joints)]))))
        size = np.where(np.isin(every, joints), now.size / factor, now.size)
        unknown = float(np.log(LIMITS.mass_spread / LIMITS.unit_spread))
        yield Change("size", replace(now, size=size), joints, "tau", "another unit", (), unknown)


def torque_changes(mapping: Mapping, joint: str) -> dict[str, ColumnChange]:
    """τ in other units, on the other side of the gear, or both: label -> change."""
    currents = CURRENT if mapping.joints[joint].torque_constant else ()
    single = conversions(mapping, joint, "tau", tuple(currents))
    units, sides = ([{}, *(one for one in single if key in one)] for key in ("unit", "side"))
    found = [
        change_of(mapping, joint, "tau", unit | side) for unit, side in product(units, sides) if unit | side
    ]
    return {str(change): change for change in found}
