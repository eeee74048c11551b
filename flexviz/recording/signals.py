"""Signals of a group: as measured, as the observer gives them, the residual, the simulated model's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexviz.charts import COLOURS
from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import Observer, ObserverStates
from flexviz.recording.columns import send_signal, stride_for
from flexviz.recording.paths import DISTURBANCE, TAU_STATES, THETA_STATES, observer_name
from flexviz.recording.stream import Stream

if TYPE_CHECKING:
    from flexviz.identification import Identification
    from flexviz.simulation import Run


def send_measured(recording: Stream, measurements: MeasurementSet, group: Group, most: int) -> None:
    """The signals as they were recorded (after resampling of jitter)."""
    where, joints = ("groups", group.name, "measured"), measurements.joints
    stride = stride_for(group.samples, most)
    time = np.concatenate([segment.time[::stride] for segment in group.segments])
    for name in ("theta", "tau"):
        values = np.concatenate([getattr(segment, name)[::stride] for segment in group.segments])
        send_signal(recording, (*where, name), joints, time, values, "measured", COLOURS.reference)
    stride = stride_for(len(group.time), most)
    for name in ("q", "tau_joint", "theta_ref"):
        optional = getattr(group, name)
        if optional is not None:
            send_signal(recording, (*where, name), joints, group.time[::stride], optional[::stride], name)


def send_states(
    recording: Stream, measurements: MeasurementSet, group: Group, observer: Observer, most: int
) -> None:
    """All observer states; those within the transients apart, so that they do not spoil the plots' scale."""
    stride = stride_for(group.samples, most)
    parts = [observer.states(segment, measurements.torque_hold) for segment in group.segments]
    where = ("observers", observer_name(observer), group.name)
    for kind, inside in (((), True), (("transients",), False)):
        kept = [np.flatnonzero(part.valid == inside)[::stride] for part in parts]
        time = np.concatenate([part.time[rows] for part, rows in zip(parts, kept, strict=True)])
        for name in (*THETA_STATES, *TAU_STATES, DISTURBANCE):
            columns = [state(part, name) for part in parts]
            if any(column is None for column in columns):
                continue
            values = np.concatenate([column[rows] for column, rows in zip(columns, kept, strict=True)])  # type: ignore[index]
            send_signal(recording, (*where, *kind, name), measurements.joints, time, values, observer.name)


def state(states: ObserverStates, name: str) -> np.ndarray | None:
    """One of the states by its entity's name: (N, n), or None where the observer has none."""
    if name == DISTURBANCE:
        return states.disturbance
    kind, _, order = name.partition("_")
    return getattr(states, kind)[int(order)]


def send_residual(
    recording: Stream, joints: tuple[str, ...], number: int, group: str, result: Identification, most: int
) -> None:
    """The residual of the identification equation, with what belongs to it."""
    series = result.residuals.get(group)
    if series is None:
        return
    where, stride = ("results", str(number), "groups", group), stride_for(len(series.time), most)
    for name in ("residual", "torque", "q"):
        values = getattr(series, name)[::stride]
        send_signal(recording, (*where, name), joints, series.time[::stride], values)


def send_run(
    recording: Stream, joints: tuple[str, ...], number: int, group: str, run: Run, most: int
) -> None:
    """The simulated motion of the identified model."""
    stride = stride_for(len(run.time), most)
    where = ("results", str(number), "groups", group, "simulated")
    for name in ("theta", "q", "tau"):
        values = getattr(run, name)[::stride]
        send_signal(recording, (*where, name), joints, run.time[::stride], values, "simulated")
