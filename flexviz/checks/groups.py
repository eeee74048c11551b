"""Checks of groups against the robot and against each other, for imports and for sets made elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexviz.checks.columns import check_optional_columns, compared_with
from flexviz.checks.issues import Issue, Severity, with_sliding
from flexviz.checks.rigid import Comparison, LoadedTable
from flexviz.checks.thresholds import LIMITS
from flexviz.checks.torques import check_torques
from flexviz.data.logs import Mapping
from flexviz.robot.robot import Robot


def check_groups(
    mapping: Mapping,
    robot: Robot,
    groups: Sequence[LoadedTable],
    guessed: bool = False,
    watch: Callable[[], None] = lambda: None,
) -> list[Issue]:
    """Units, signs, zero positions and mix-ups that the data contradict.

    `guessed`: the payloads are not known yet, so the group that is explained best alone decides. `watch` is
    called before each reading of the columns; it may raise to stop.
    """
    comparison = Comparison(robot, groups, watch)
    if guessed and len(groups) > 1:
        comparison = max((Comparison(robot, [group], watch) for group in groups), key=Comparison.best_score)
    found = check_torques(mapping, comparison, not guessed)
    known = {(joint, signal) for s in found for joint in s.joints for signal in s.signal.split(" and ")}
    found += [s for s in check_range(mapping, comparison) if (s.joints[0], "theta") not in known]
    # a wrong θ makes its torque and the columns compared with it inconclusive
    wrong_theta = {s.joints[0] for s in found if s.signal == "theta"}
    found = [s for s in found if s.kind != "unexplained" or not wrong_theta & set(s.joints)]
    known |= {(joint, "theta") for joint in wrong_theta}
    for issue in check_optional_columns(mapping, [table for _, table in groups]):
        signals = {"swapped": ("theta", "tau")}.get(issue.kind, (compared_with(issue.signal),))
        if not any((issue.joints[0], signal) in known for signal in signals):
            found.append(issue)
    return with_sliding(found, robot)


def check_range(mapping: Mapping, model: Comparison) -> list[Issue]:
    """Positions that leave the joint's range, or move faster than it can, by far."""
    found = []
    for j, joint in enumerate(mapping.names):
        span, speed = (float(np.max(x[:, j])) for x in (model.span, model.speed))
        excess = max(span / model.width[j], speed / model.fastest[j])
        if excess < LIMITS.beyond:
            continue
        limits = {name: float(getattr(model, name)[j]) for name in ("width", "fastest")}
        unit = "m" if model.robot.prismatic[j] else "rad"
        values = {"span": span, "speed": speed, **limits, "unit": unit}
        values["times"] = min(span / model.width[j], speed / model.fastest[j])
        severity: Severity = "wrong" if excess > LIMITS.far_beyond else "odd"
        found.append(Issue("unit", severity, (joint,), "theta", values))
    return found
