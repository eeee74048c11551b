"""From the traces of one log to the columns of one group: everything on the clock of the first joint's θ."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.importing.log import SHORTEST, Log
from flexviz.importing.mapping import SIGNALS, LogEntry, Mapping
from flexviz.importing.traces import Trace, Tracer
from flexviz.measurements import Array, GroupTable

NEEDED, OPTIONAL = SIGNALS[:2], SIGNALS[2:]
MOST_HELD = 0.05  # share of the rows in which a column for comparison may repeat its first or last value


Traces = dict[tuple[str, str], Trace]


@dataclass(frozen=True, eq=False)
class Assembled:
    """One group to be.

    Attributes:
        entry: the log's entry in the mapping.
        log: what kind of log it is.
        table: its columns (N, n), time from 0.
        traces: (joint, signal) -> as it is on its own clock.
        zero: [s] where the table's time 0 lies on the clock of the traces.
        notes: what was done to the data, one sentence each.
    """

    entry: LogEntry
    log: str
    table: GroupTable
    traces: Traces
    zero: float
    notes: tuple[str, ...]


def assemble(log: Log, entry: LogEntry, mapping: Mapping, file: Path) -> Assembled:
    """The group that `entry` asks for. Errors name the mapping `file` and the key, or the log and the row."""
    tracer = Tracer(log, mapping, file)
    # θ of the first joint first: its clock is the group's
    ordered = sorted(mapping.signals(), key=lambda item: SIGNALS.index(item[1]))
    traces = {(joint, name): tracer.trace(joint, name, signal) for joint, name, signal in ordered}
    notes = [*log.notes, *tracer.notes]
    time = chosen_time(traces[mapping.names[0], "theta"], entry, log, file)
    values: dict[tuple[str, str], Array] = {}
    keep = np.ones(len(time), dtype=bool)
    for key in (key for key in traces if key[1] in NEEDED):
        values[key], usable = needed(traces[key], time, traces[mapping.names[0], "theta"], notes)
        keep &= usable
        if np.count_nonzero(keep) < SHORTEST:
            raise no_overlap(traces[key], traces[mapping.names[0], "theta"], log, file)
    for key in (key for key in traces if key[1] in OPTIONAL):
        # what is for comparison only never changes the rows that are identified from
        trace = traces[key]
        first, last = trace.reach
        outside = int(np.count_nonzero((time < first) | (time > last)))
        if outside > MOST_HELD * len(time):
            share = 100 * (1 - outside / len(time))
            notes.append(f'"{trace.column}" covers {share:.0f} % of θ\'s time and is left out')
            continue
        if outside:
            notes.append(f'{outside} samples outside the time of "{trace.clock}" repeat its value at the end')
        values[key] = trace.at(np.clip(time, first, last))[0]
    if not keep.all():
        time = time[keep]
        values = {key: column[keep] for key, column in values.items()}
    columns = {name: together(values, mapping.names, name, len(time)) for name in SIGNALS}
    zero = float(time[0])
    table = GroupTable(
        entry.group,
        entry.trajectory or entry.group,
        entry.payload,
        time - zero,
        columns["theta"],  # type: ignore[arg-type]
        columns["tau"],  # type: ignore[arg-type]
        columns["q"],
        columns["tau_joint"],
        columns["theta_ref"],
        validation=entry.validation,
    )
    return Assembled(entry, log.kind, table, traces, zero, tuple(dict.fromkeys(notes)))


def chosen_time(base: Trace, entry: LogEntry, log: Log, file: Path) -> Array:
    """(N,) the instants of θ between `from` and `to`."""
    time = base.time
    if entry.start > 0.0 or entry.stop is not None:
        last = np.inf if entry.stop is None else time[0] + entry.stop
        time = time[(time >= time[0] + entry.start) & (time <= last)]
    if len(time) < SHORTEST:
        span = f"from {entry.start:g} s" + ("" if entry.stop is None else f" to {entry.stop:g} s")
        raise InputError(
            f"{log.file.name} has {len(time)} samples {span}, at least {SHORTEST} would be right; it lasts "
            f"{base.time[-1] - base.time[0]:.6g} s",
            file=file,
            place=f'log "{entry.group}"',
        )
    return time


def needed(trace: Trace, time: Array, base: Trace, notes: list[str]) -> tuple[Array, NDArray[np.bool_]]:
    """A column that identification needs at `time` (N,), and where it has values."""
    if trace.shares_instants(base):
        return trace.values[np.searchsorted(base.time, time)], np.ones(len(time), dtype=bool)
    values, covered, gap = trace.at(time)
    if trace.clock == base.clock:
        lost = int(np.count_nonzero(gap))
        also = f"; {lost} samples in longer gaps are left out" if lost else ""
        notes.append(f'"{trace.column}" does not have a value in every row and is interpolated{also}')
    else:
        notes.append(
            f'"{trace.clock}" ({1 / trace.step:.5g} Hz) is brought to the instants of "{base.clock}" '
            f"({1 / base.step:.5g} Hz) by interpolation"
        )
    return values, covered & ~gap


def no_overlap(trace: Trace, base: Trace, log: Log, file: Path) -> InputError:
    """θ and τ were not recorded at the same time, or their clocks differ."""
    return InputError(
        f'in {log.file.name} "{trace.column}" runs from {trace.time[0]:.6g} s to {trace.time[-1]:.6g} s and '
        f'"{base.column}" from {base.time[0]:.6g} s to {base.time[-1]:.6g} s: they do not overlap; '
        f'clock = "log" (the time of recording) or shift."{trace.clock}" (seconds to add) would be right',
        file=file,
        place="time",
    )


def together(
    values: dict[tuple[str, str], Array], joints: tuple[str, ...], name: str, count: int
) -> Array | None:
    """(N, n) a signal of all joints, NaN for those without; None where no joint has it."""
    if not any((joint, name) in values for joint in joints):
        return None
    nothing = np.full(count, np.nan)
    return np.stack([values.get((joint, name), nothing) for joint in joints], axis=1)
