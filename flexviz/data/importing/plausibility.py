"""All checks of groups against the robot and against each other, for imports and for sets made elsewhere."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from flexviz.base.errors import Cancelled
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.data.importing.comparison import Comparison, LoadedTable
from flexviz.data.importing.cross_checks import check_optional_columns
from flexviz.data.importing.doubts import check_torques
from flexviz.data.importing.mapping import Issue, Mapping, parse
from flexviz.data.importing.thresholds import LIMITS
from flexviz.data.measurements import GroupTable, MeasurementSet
from flexviz.robot.robot import Robot

log = logging.getLogger(__name__)
COMPARING = "comparing the torques with the robot's masses"


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
        signals = ("theta", "tau") if issue.kind == "swapped" else ("theta",)
        if not any((issue.joints[0], signal) in known for signal in signals):
            found.append(issue)
    return found


def check_range(mapping: Mapping, model: Comparison) -> list[Issue]:
    """Positions that leave the joint's range, or move faster than it can, by far."""
    found = []
    for j, joint in enumerate(mapping.names):
        excess = max(model.span[j] / model.width[j], model.speed[j] / model.fastest[j])
        if excess < LIMITS.beyond:
            continue
        unit, small = (
            ("m", 'millimetres (unit = "mm")')
            if model.robot.prismatic[j]
            else ("rad", 'degrees (unit = "deg")')
        )
        message = (
            f"it spans {model.span[j]:.3g} {unit} at up to {model.speed[j]:.3g} {unit}/s, the joint's limits "
            f"are {model.width[j]:.3g} {unit} and {model.fastest[j]:.3g} {unit}/s: {small}, or the motor's "
            "angle before the gear (gear and side)?"
        )
        severity = "wrong" if excess > LIMITS.far_beyond else "odd"
        found.append(Issue("unit", severity, (joint,), "theta", message))
    return found


def with_plausibility_warnings(
    measurements: MeasurementSet, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> MeasurementSet:
    """The set with a warning, logged too, for everything that its robot's masses contradict.

    Of many joints that takes a while: stopped, it finds nothing.
    """
    texts = plausibility_warnings(measurements, progress, should_stop)
    for text in texts:
        log.warning("%s", text)
    return replace(measurements, warnings=(*texts, *measurements.warnings)) if texts else measurements


def plausibility_warnings(
    measurements: MeasurementSet, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> list[str]:
    """What a set's robot contradicts; nothing when stopped.

    An identification alone would silently fit a torque of the wrong sign or an angle in degrees.
    """
    file = measurements.path / "measurements.toml"

    def watch() -> None:
        progress(Progress(COMPARING))
        if should_stop():
            raise Cancelled

    try:
        with threadpool_limits(1, "blas"):  # the matrices are small: threads would only wait for each other
            issues = issues_of_set(measurements, watch=watch)
    except Cancelled:
        return []
    return [f"{file}: {issue}" for issue in issues if issue.severity == "wrong"]


def issues_of_set(
    measurements: MeasurementSet,
    keys: dict[str, float] | None = None,
    *,
    watch: Callable[[], None] = lambda: None,
) -> list[Issue]:
    """Issues that an import would find in θ and τ of a set, with these keys of a mapping on every joint."""
    # a mapping that takes the set's columns unchanged
    joints = {
        joint: {"theta": f"t{joint}", "tau": f"u{joint}", **(keys or {})} for joint in measurements.joints
    }
    document = {"robot": "x", "logs": [{"file": "a", "group": "a"}], "joints": joints}
    groups = [
        (group.bodies, replace(GroupTable.of(group), q=None, theta_ref=None)) for group in measurements.groups
    ]
    return check_groups(parse(document, Path("mapping")), measurements.robot, groups, watch=watch)
