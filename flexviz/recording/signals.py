"""What was measured, what the observer and the identification made of it, and the optimiser's way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import Observer, ObserverStates
from flexviz.recording.columns import send_line, send_signal, series, stride_for
from flexviz.recording.paths import (
    DISTURBANCE,
    ITERATION,
    TAU_STATES,
    THETA_STATES,
    TIME,
    parameter_path,
    path,
)
from flexviz.view.colours import REFERENCE

if TYPE_CHECKING:
    from flexviz.identification import Identification
    from flexviz.simulation.run import Run

RELATIVE = 10.0  # parameters farther from their last value than this factor are drawn there


def send_measured(
    recording: rr.RecordingStream, measurements: MeasurementSet, group: Group, most: int
) -> None:
    """The signals as they were recorded (after resampling of jitter)."""
    where, joints = ("groups", group.name, "measured"), measurements.joints
    stride = stride_for(group.samples, most)
    time = np.concatenate([segment.time[::stride] for segment in group.segments])
    for name in ("theta", "tau"):
        values = np.concatenate([getattr(segment, name)[::stride] for segment in group.segments])
        send_signal(recording, (*where, name), joints, time, values, "measured", REFERENCE)
    stride = stride_for(len(group.time), most)
    for name in ("q", "tau_joint", "theta_ref"):
        optional = getattr(group, name)
        if optional is not None:
            send_signal(recording, (*where, name), joints, group.time[::stride], optional[::stride], name)


def send_states(
    recording: rr.RecordingStream, measurements: MeasurementSet, group: Group, observer: Observer, most: int
) -> None:
    """All observer states; those within the transients apart, so that they do not spoil the plots' scale."""
    stride = stride_for(group.samples, most)
    parts = [observer.states(segment, measurements.torque_hold) for segment in group.segments]
    for kind, inside in (("states", True), ("transients", False)):
        kept = [np.flatnonzero(part.valid == inside)[::stride] for part in parts]
        time = np.concatenate([part.time[rows] for part, rows in zip(parts, kept, strict=True)])
        for name in (*THETA_STATES, *TAU_STATES, DISTURBANCE):
            columns = [state(part, name) for part in parts]
            if any(column is None for column in columns):
                continue
            values = np.concatenate([column[rows] for column, rows in zip(columns, kept, strict=True)])  # type: ignore[index]
            send_signal(
                recording,
                ("groups", group.name, kind, name),
                measurements.joints,
                time,
                values,
                observer.name,
            )


def state(states: ObserverStates, name: str) -> np.ndarray | None:
    """One of the states by its entity's name: (N, n), or None where the observer has none."""
    if name == DISTURBANCE:
        return states.disturbance
    kind, _, order = name.partition("_")
    return getattr(states, kind)[int(order)]


def send_identification(
    recording: rr.RecordingStream, measurements: MeasurementSet, group: Group, result: Identification
) -> None:
    """The residual of the identification equation, with what belongs to it."""
    series = result.residuals.get(group.name)
    if series is None:
        return
    where = ("groups", group.name, "identification")
    for name in ("residual", "torque", "q"):
        send_signal(
            recording, (*where, name), measurements.joints, series.time, getattr(series, name), "identified"
        )


def send_run(
    recording: rr.RecordingStream, measurements: MeasurementSet, group: Group, run: Run, most: int
) -> None:
    """The simulated motion of the identified model."""
    stride = stride_for(len(run.time), most)
    for name in ("theta", "q", "tau"):
        send_signal(
            recording,
            ("groups", group.name, "identified", name),
            measurements.joints,
            run.time[::stride],
            getattr(run, name)[::stride],
            "identified",
        )


def send_optimiser(recording: rr.RecordingStream, result: Identification) -> None:
    """Cost, step and every parameter of each iteration.

    On `iteration`, and on `time` as seconds since the start: the recorded total, spread evenly.
    """
    iterations = result.iterations
    if not iterations:
        return
    count = len(iterations)
    seconds = result.seconds * (np.arange(count) + 1) / count

    def indexes(rows: list[int]) -> list[rr.TimeColumn]:
        numbers = [row + 1 for row in rows]
        return [rr.TimeColumn(ITERATION, sequence=numbers), rr.TimeColumn(TIME, duration=seconds[rows])]

    everyone = list(range(count))
    for colour, name in enumerate(("cost", "step")):
        values = np.array([float(getattr(iteration, name)) for iteration in iterations])
        send_line(recording, path("optimiser", name), indexes(everyone), values)  # in the table, not drawn
        usable = np.isfinite(values) & (values > 0.0)
        logarithm = np.log10(np.where(usable, values, np.nan))
        where, label = path("optimiser", f"log10_{name}"), f"log10 {name}"
        send_line(recording, where, indexes(everyone), logarithm, label, series(colour))
    stages = rr.TextLog.columns(text=[iteration.stage for iteration in iterations])
    recording.send_columns(path("optimiser", "stage"), indexes(everyone), stages)
    for colour, name in enumerate(parameter_names(result)):
        rows = [i for i in everyone if name in iterations[i].names]
        values = np.array(
            [iterations[i].values[list(iterations[i].names).index(name)] for i in rows], dtype=float
        )
        label, last = name.replace(":", " "), values[-1] or 1.0
        send_line(recording, parameter_path("parameters", name), indexes(rows), values)
        relative = np.clip(values / last, -RELATIVE, RELATIVE)
        send_line(recording, parameter_path("relative", name), indexes(rows), relative, label, series(colour))


def parameter_names(result: Identification) -> list[str]:
    """Every parameter that some iteration moves."""
    return list(dict.fromkeys(name for iteration in result.iterations for name in iteration.names))
