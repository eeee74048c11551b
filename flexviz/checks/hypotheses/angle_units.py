"""θ in another unit or before its gear, on one joint or on all that can be so; or in no known unit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS
from flexviz.data.logs import GEARS, ColumnChange, Fix, theta_changes

TRIED = 12  # scales between the smallest and the largest gear, of θ that no unit explains
FULL, LEAST = 100.0, 10.0  # per cent of a range; less of all joints is hardly such a record
HALVINGS = 6  # of the ratio of two of them, to 1 % of the scale


def scaled(by: Array) -> Callable[[Reading], Reading]:
    """θ times (n,) or (groups, n)."""
    return lambda now: replace(now, factor=now.factor * by)


@hypothesis
def angle_units(case: Case) -> Iterator[Fault]:
    comparison, now, names = case.comparison, case.now, case.mapping.names
    by_label: dict[str, dict[int, ColumnChange]] = {}
    for j, joint in enumerate(names):
        for change in theta_changes(case.mapping, joint):
            by_label.setdefault(str(change), {})[j] = change
    beyond = comparison.beyond(now)
    by_q = _unknown_ratios(comparison.by_q * beyond, by_label)
    if joints := tuple(int(j) for j in np.flatnonzero(by_q)):
        ratios = {j: float(abs(comparison.by_q[j])) for j in joints}
        factor = case.at(joints, 1.0 / np.maximum(np.abs(comparison.by_q * now.factor[0]), 1e-300))
        yield Fault("unit", joints, "theta", scaled(factor), "q", values={"times_q": ratios})
    if far := tuple(int(j) for j in np.flatnonzero(beyond & (comparison.by_q == 0.0))):
        yield _unknown_scale(case, far)
    for label, members in by_label.items():
        for group in ([members] if len(members) > 1 else []) + [{j: c} for j, c in members.items()]:
            factor = np.ones(len(names))
            for j, change in group.items():
                factor[j] = change.factor
            reading = scaled(factor)(now)
            # a joint that moved so little that nobody would have recorded it is no better explanation
            span = np.max(comparison.span[:, list(now.theta_order)] * np.abs(reading.factor), axis=0)
            if any(c.factor > 1.0 and comparison.beyond(reading)[j] for j, c in group.items()) or all(
                span[j] < LIMITS.smallest_motion for j in group
            ):
                continue
            fixes = tuple(fix for change in group.values() for fix in change.fixes)
            yield Fault("unit", tuple(group), "theta", scaled(factor), label, fixes)


@hypothesis
def of_one_log(case: Case) -> Iterator[Fault]:
    """All angles of one group in another unit, as where another program has logged them."""
    names = case.mapping.names
    if len(case.comparison.names) < 2:
        return
    changes = [{str(one): one.factor for one in theta_changes(case.mapping, joint)} for joint in names]
    for label in (label for label in changes[0] if all(label in own for own in changes)):
        for g, group in enumerate(case.comparison.names):
            by = case.of_group(g, np.array([own[label] for own in changes]))
            values = {"groups": (group,), "read_as": label}
            yield Fault("unit", case.every, "theta", scaled(by), label, values=values, groups=(g,))


def _unknown_ratios(by_q: Array, by_label: Mapping[str, Mapping[int, ColumnChange]]) -> Array:
    """θ per q (n,) of joints of which no unit or gear has that factor, else 0."""
    by_q = by_q.copy()
    for j in map(int, np.flatnonzero(by_q)):
        ratios = [abs(change[j].factor * by_q[j]) for change in by_label.values() if j in change]
        if any(1 / LIMITS.agrees < ratio < LIMITS.agrees for ratio in ratios):
            by_q[j] = 0.0
    return by_q


def _unknown_scale(case: Case, joints: tuple[int, ...]) -> Fault:
    """θ of joints that leave their range: the scales that explain the torques best.

    It may be the motor's angle before an unknown gear, or be in per cent of the joint's range.
    """
    comparison, now = case.comparison, case.now

    def scores(by: Array) -> float:
        return comparison.score(scaled(by)(now))

    def times(by: Array, one: Sequence[int], ratio: float) -> Array:
        return by * case.at(one, ratio)

    step = float((GEARS[1] / GEARS[0]) ** (1 / (TRIED - 1)))
    best = max((case.at(joints, 1 / gear) for gear in np.geomspace(*GEARS, TRIED)), key=scores)
    for _ in range(HALVINGS):
        step = np.sqrt(step)
        for one in (joints, *((j,) for j in joints if len(joints) > 1)):
            best = max((best, *(times(best, one, by) for by in (step, 1 / step))), key=scores)
    # a scale of its own on each joint, found to this ratio
    prior = -len(joints) * np.log(np.log(GEARS[1] / GEARS[0]) / np.log(step))
    columns = [case.mapping.joints[name] for name in case.mapping.names]
    sizes = {j: float(abs(best[j] * columns[j].scale(columns[j].theta))) for j in joints}
    gears = {j: float(abs(1 / best[j])) for j in joints}
    values = {"unit_sizes": sizes, "gears": gears}
    return Fault("unit", joints, "theta", scaled(best), "scale", prior=float(prior), values=values)


@hypothesis
def per_cent(case: Case) -> Iterator[Fault]:
    """θ in per cent of the joints' ranges, −100 … 100, as servo buses' software has it."""
    comparison, names = case.comparison, case.mapping.names
    columns = [case.mapping.joints[name] for name in names]
    scales = np.array([entry.scale(entry.theta) for entry in columns])
    counts = np.max(np.abs(np.concatenate(comparison.q)), axis=0) / np.abs(scales)
    robot = comparison.robot
    limited = np.isfinite(robot.upper_limit) & np.isfinite(robot.lower_limit) & ~robot.prismatic
    if not limited.all() or np.any(counts > FULL) or np.all(counts < LEAST):
        return
    sizes = (robot.upper_limit - robot.lower_limit) / (2 * FULL)
    middle = (robot.upper_limit + robot.lower_limit) / 2
    stated = (("unit", sizes), ("offset", middle))
    every = [(name, key, round(float(x[j]), 6)) for j, name in enumerate(names) for key, x in stated]
    fixes = tuple(Fix(name, "theta", key, value) for name, key, value in every if value != 0.0)

    def of_range(now: Reading) -> Reading:
        return replace(now, factor=now.factor * sizes / np.abs(scales), zero=now.zero + middle)

    yield Fault("unit", case.every, "theta", of_range, "per cent", fixes, values={"per_cent": True})


@hypothesis
def unused_gears(case: Case) -> Iterator[Fault]:
    """θ and τ of the motors, where a gear is stated and neither is said to be before it."""
    unused = tuple(j for j in case.every if _gear_unused(case, j))
    if not unused:
        return
    names = case.mapping.names
    ratios = case.at(unused, np.array([case.mapping.joints[name].ratio for name in names]))

    def behind(now: Reading) -> Reading:
        return replace(now, factor=now.factor / ratios, size=now.size * ratios)

    fixes = tuple(Fix(names[j], signal, "side", "motor") for j in unused for signal in ("theta", "tau"))
    yield Fault("unit", unused, "theta and tau", behind, "side", fixes)


def _gear_unused(case: Case, j: int) -> bool:
    columns = case.mapping.joints[case.mapping.names[j]]
    sides = {signal.side for signal in (columns.theta, columns.tau) if signal is not None}
    return abs(columns.ratio) != 1.0 and sides == {"joint"}
