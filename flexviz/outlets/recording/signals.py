"""Signals of a group, sent as whole columns: measured, observer states, residual, simulated model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from flexviz.content.charts import COLOURS, rgb
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.observers import Observer, ObserverStates
from flexviz.outlets.recording.paths import DISTURBANCE, STATES, TIME, observer_name, path
from flexviz.outlets.recording.stream import Stream

Array = NDArray[Any]
GAP = 2.5  # [median intervals] longer intervals break the line


class Series(Protocol):
    """A record of signals over time (N,) [s]."""

    @property
    def time(self) -> Array: ...


def send_measured(stream: Stream, measurements: MeasurementSet, group: Group, most: int) -> None:
    """The measured signals, resampled if their time jitters; about `most` samples at most."""
    where, joints = ("groups", group.name, "measured"), measurements.joints
    stride = stride_for(group.samples, most)
    time = np.concatenate([segment.time[::stride] for segment in group.segments])
    for name in ("theta", "tau"):
        values = np.concatenate([getattr(segment, name)[::stride] for segment in group.segments])
        send_signal(stream, (*where, name), joints, time, values, "measured", COLOURS.reference)
    for name in ("q", "tau_joint", "theta_ref"):
        if getattr(group, name) is not None:
            send_series(stream, where, joints, group, (name,), most, name)


def send_states(
    stream: Stream, measurements: MeasurementSet, group: Group, observer: Observer, most: int
) -> None:
    """All observer states; transients are separate entities, so that they do not scale the plots."""
    stride = stride_for(group.samples, most)
    parts = [observer.states(segment, measurements.torque_hold) for segment in group.segments]
    where = ("observers", observer_name(observer), group.name)
    for kind, inside in (((), True), (("transients",), False)):
        kept = [np.flatnonzero(part.valid == inside)[::stride] for part in parts]
        time = np.concatenate([part.time[rows] for part, rows in zip(parts, kept, strict=True)])
        for name in state_names(observer):
            columns = [_state(part, name)[rows] for part, rows in zip(parts, kept, strict=True)]
            values = np.concatenate(columns)
            send_signal(stream, (*where, *kind, name), measurements.joints, time, values, observer.name)


def state_names(observer: Observer) -> tuple[str, ...]:
    """The entities of an observer's states."""
    return (*STATES, DISTURBANCE) if observer.has_disturbance_state else STATES


def _state(states: ObserverStates, name: str) -> Array:
    """The state (N, n) with this entity name."""
    if name == DISTURBANCE:
        assert states.disturbance is not None
        return states.disturbance
    kind, _, order = name.partition("_")
    return getattr(states, kind)[int(order)]


def send_series(
    stream: Stream,
    where: Sequence[object],
    joints: Sequence[str],
    series: Series,
    names: Iterable[str],
    most: int,
    label: str = "",
) -> None:
    """The signals (N, n) with these names in a record with `time` (N,) [s]; about `most` samples at most."""
    stride = stride_for(len(series.time), most)
    for name in names:
        values = getattr(series, name)[::stride]
        send_signal(stream, (*where, name), joints, series.time[::stride], values, label)


def send_signal(
    stream: Stream,
    where: Sequence[object],
    joints: Sequence[str],
    time: Array,
    values: Array,
    label: str = "",
    colour: str | None = None,
) -> None:
    """One signal of every joint: entity `where`/<joint> on the timeline `time`.

    Args:
        stream: the open recording.
        where: parts of the path.
        joints: their names; the label follows them in the legend.
        time: (N,) [s].
        values: (N, n); a joint whose values are all NaN is skipped.
        label, colour: of every line; without a colour each joint has its own.
    """
    time, values = broken_at_gaps(np.asarray(time, dtype=float), np.asarray(values, dtype=float))
    if len(time) == 0:
        return
    index = rr.TimeColumn(TIME, duration=time)
    for j, joint in enumerate(joints):
        if not np.isnan(values[:, j]).all():
            name = f"{joint} {label}".strip()
            send_line(stream, path(*where, joint), [index], values[:, j], name, colour or series_colour(j))


def send_line(
    stream: Stream,
    entity: str,
    indexes: Sequence[rr.TimeColumn],
    values: Array,
    name: str = "",
    colour: str = "",
    width: float = 1.5,
) -> None:
    """Values (N,) of one line of a plot, with its style if it has a name."""
    if name:
        stream.log(entity, rr.SeriesLines(names=name, colors=rgb(colour), widths=width), static=True)
    stream.send_columns(entity, indexes, rr.Scalars.columns(scalars=np.ascontiguousarray(values)))


def stride_for(samples: int, most: int) -> int:
    """The stride that keeps about `most` samples at most."""
    return max(1, -(-samples // most))


def broken_at_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """`time` (N,) and `values` (N, n) with a NaN row in every gap, which breaks the lines."""
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    middle = (time[gaps] + time[gaps - 1]) / 2
    return np.insert(time, gaps, middle), np.insert(values, gaps, np.nan, axis=0)


def series_colour(number: int) -> str:
    """The colour of the number-th line."""
    return COLOURS.series[number % len(COLOURS.series)]
