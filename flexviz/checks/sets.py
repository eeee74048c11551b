"""What a set's robot contradicts: an identification alone would silently fit a torque of the wrong sign."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary, ref

from threadpoolctl import threadpool_limits

from flexviz.base.errors import Cancelled
from flexviz.base.facts import Fact
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.checks.groups import check_groups
from flexviz.checks.issues import Issue
from flexviz.checks.samples import kept, other_samples, spoilt_samples
from flexviz.checks.set_samples import samples_of, shortened
from flexviz.content.records import RecordingEntry
from flexviz.data.logs import Mapping as LogMapping
from flexviz.data.logs import parse_mapping
from flexviz.data.measurements import FILE_NAME, OPTIONAL_SIGNALS, Group, GroupTable, MeasurementSet
from flexviz.robot.robot import Robot

log = logging.getLogger(__name__)
# first group -> robot and groups of a set, and what was found: its other settings change nothing of it
_FOUND: WeakKeyDictionary[Group, tuple[list[ref[Any]], tuple[Issue, ...]]] = WeakKeyDictionary()
NAMED_ELSEWHERE = ("silent", "saturated", "filtered", "references")  # masks: by identification and diagnosis
HARMLESS = ("constant", "repeated")  # kinds: named while a set is read, or counted in its noise
COMPARING = Fact("comparing-torques")


def with_plausibility_warnings(
    measurements: MeasurementSet, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> MeasurementSet:
    """The set with a warning, logged too, for everything that its robot's masses contradict.

    Of many joints that takes a while: stopped, it finds nothing.
    """
    facts = plausibility_warnings(measurements, progress, should_stop)
    for fact in facts:
        log.warning("%s", fact)
    return replace(measurements, warnings=(*facts, *measurements.warnings)) if facts else measurements


def plausibility_warnings(
    measurements: MeasurementSet, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> list[Fact]:
    """What a set's robot contradicts; nothing when stopped."""
    file = str(measurements.path / FILE_NAME)
    found = contradictions(measurements, progress, should_stop)
    return [
        Fact("contradiction", one.severity, one.joints, file=file, values={"issue": one}) for one in found
    ]


def recording_entries(
    measurements: MeasurementSet, should_stop: StopCallback | None = None
) -> tuple[RecordingEntry, ...]:
    """The same for documents."""
    return tuple(
        RecordingEntry(one.kind, one.severity, one.joints, one.signal, dict(one.values), str(one))
        for one in contradictions(measurements, ignore, should_stop or never)
    )


def contradictions(
    measurements: MeasurementSet, progress: ProgressCallback = ignore, should_stop: StopCallback = never
) -> tuple[Issue, ...]:
    """What a set's robot contradicts, found once per set; nothing when stopped, or without a torque."""
    if measurements.drive is not None:
        return ()
    first, parts = measurements.groups[0], [ref(measurements.robot), *map(ref, measurements.groups)]
    if first not in _FOUND or _FOUND[first][0] != parts:

        def watch() -> None:
            progress(Progress(COMPARING.text))
            if should_stop():
                raise Cancelled

        try:
            with threadpool_limits(1, "blas"):  # the matrices are small: threads would wait for each other
                watch()
                samples = issues_of_samples(measurements)
                issues = issues_of_set(measurements, watch=watch, samples=samples)
        except Cancelled:
            return ()
        told = (replace(issue, proposals=()) for issue in samples if issue.kind not in HARMLESS)
        _FOUND[first] = parts, (*(issue for issue in issues if issue.severity == "wrong"), *told)
    return _FOUND[first][1]


def issues_of_samples(measurements: MeasurementSet) -> list[Issue]:
    """What is wrong with samples; nothing of spoilt ones, which are refused."""
    samples = samples_of(measurements)
    return [] if spoilt_samples(samples) else other_samples(samples, NAMED_ELSEWHERE)


def issues_of_set(
    measurements: MeasurementSet,
    keys: dict[str, float] | None = None,
    *,
    watch: Callable[[], None] = lambda: None,
    samples: Sequence[Issue] = (),
) -> list[Issue]:
    """Issues that an import would find in a set's columns, with these keys of a mapping on every joint.

    What issues of `samples` propose to leave out is not compared.
    """
    mapping = stated_mapping(measurements.robot, keys)
    every = ((group, GroupTable.of(group)) for group in measurements.groups)
    groups = [
        (group.bodies, shortened(table, kept(samples, group.name, table.time))) for group, table in every
    ]
    return check_groups(mapping, measurements.robot, groups, watch=watch)


def stated_mapping(robot: Robot, keys: dict[str, float] | None = None) -> LogMapping:
    """A mapping that takes a set's columns unchanged, or with these keys on every joint."""
    own = ("theta", "tau", *OPTIONAL_SIGNALS)
    joints = {joint: {**{name: f"{name}_{joint}" for name in own}, **(keys or {})} for joint in robot.joints}
    document = {"robot": "x", "logs": [{"file": "a", "group": "a"}], "joints": joints}
    return parse_mapping(document, Path("mapping")).for_joints(robot.prismatic, Path("mapping"))
