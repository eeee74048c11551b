"""The samples of a set that was read, as masks look at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.base.arrays import Bools
from flexviz.checks.issues import Issue
from flexviz.checks.samples import AllSamples, GroupSamples, spoilt_samples
from flexviz.data.logs import SHORTEST
from flexviz.data.measurements import OPTIONAL_SIGNALS, Group, GroupTable, MeasurementSet
from flexviz.data.noise import Channel
from flexviz.robot.robot import Robot

_SPOILT: WeakKeyDictionary[Group, tuple[Issue, ...]] = WeakKeyDictionary()


def samples_of(measurements: MeasurementSet, groups: Sequence[Group] | None = None) -> AllSamples:
    """The groups of a set; default: all of them."""
    groups = measurements.groups if groups is None else groups
    every = tuple(_recording(group, measurements.robot) for group in groups if group.segments)
    return AllSamples(measurements.robot, every, measurements.no_torque)


def _recording(group: Group, robot: Robot) -> GroupSamples:
    time, theta, tau = (group.joined(name) for name in ("time", "theta", "tau"))
    rows = np.searchsorted(group.time, time - 1e-9)  # of the table, before jitter was resampled
    of = partial(Channel, rows=np.minimum(rows, len(group.time) - 1))
    signals = (("theta", theta), ("tau", tau))
    channels = [of(name, joint, time, y[:, j]) for name, y in signals for j, joint in enumerate(robot.joints)]
    return GroupSamples(group.name, tuple(channels), time, theta, tau, group.bodies)


def shortened(table: GroupTable, used: Bools) -> GroupTable:
    """A table with the instants (N,) that are used, unless they are too few."""
    if used.all() or np.count_nonzero(used) < SHORTEST:
        return table
    columns = {name: getattr(table, name) for name in ("time", "theta", "tau", *OPTIONAL_SIGNALS)}
    return replace(table, **{name: x[used] for name, x in columns.items() if x is not None})


def spoilt_group(group: Group, robot: Robot) -> tuple[Issue, ...]:
    """What spoils the signals of one group, found once; the signal with the most samples concerned first."""
    if group not in _SPOILT:
        found = spoilt_samples(AllSamples(robot, (_recording(group, robot),)))
        _SPOILT[group] = tuple(sorted(found, key=lambda issue: -issue.values["count"]))
    return _SPOILT[group]
