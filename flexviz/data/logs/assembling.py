"""From the columns of one log to one group: SI at the joint side, on the clock of the first joint's θ."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexviz.base.arrays import Bools, Indices
from flexviz.base.errors import InputError
from flexviz.base.spelling import number
from flexviz.data.logs.clocks import LogClock, clock_of, rows_in_order
from flexviz.data.logs.formats.base import SHORTEST, Log
from flexviz.data.logs.mapping import SIGNALS, LogEntry, Mapping, TorqueColumn
from flexviz.data.measurements import GAP, POINTS, Array, GroupTable, interpolate
from flexviz.data.noise import Channel, outliers, sign_magnitude, unwrapped

CONTINUED = 1.5  # own steps by which a signal may be continued beyond its first and last sample
HELD_ENDS = 0.05  # share of rows in which a column for comparison may repeat its first or last value


@dataclass(frozen=True, eq=False)
class Trace:
    """One signal of one joint on its own clock, where it has values."""

    column: str  # where it comes from
    clock: str  # what its clock is called (topic or time column)
    time: Array  # (N,) strictly increasing seconds after the log's first instant
    values: Array  # (N,) [rad] or [Nm] behind the gear, before a coupling and without offset
    rows: Indices  # (N,) of the table, from 0
    scale: float = 1.0  # one unit of the column [rad], [Nm]; negative for the opposite sign
    incomplete: Bools | None = None  # (N,) whether the row lacks another signal of its table

    @property
    def step(self) -> float:
        """Median step [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def reach(self) -> tuple[float, float]:
        """From when to when it is known or safely continued [s]."""
        beyond = CONTINUED * self.step
        return float(self.time[0]) - beyond, float(self.time[-1]) + beyond

    def at(self, wanted: Array) -> tuple[Array, Bools, Bools]:
        """Values at `wanted` (M,) [s], where the trace covers them, and where they lie in a gap of it.

        Polynomials through the six nearest samples; straight lines over a gap and beyond the ends.
        """
        first, last = self.reach
        covered = (wanted >= first) & (wanted <= last)
        after = np.clip(np.searchsorted(self.time, wanted), 1, len(self.time) - 1)
        width = self.time[after] - self.time[after - 1]
        inside = (wanted >= self.time[0]) & (wanted <= self.time[-1])
        between = (wanted != self.time[after]) & (wanted != self.time[after - 1])
        gap = inside & between & (width > GAP * self.step)
        slope = (self.values[after] - self.values[after - 1]) / width
        result = self.values[after - 1] + slope * (wanted - self.time[after - 1])
        smooth = inside & ~gap
        if len(self.time) >= POINTS and smooth.any():
            result[smooth] = interpolate(self.time, self.values, wanted[smooth])
        return result, covered, gap


Traces = dict[tuple[str, str], Trace]  # (joint, signal) -> its trace


def read_traces(log: Log, entry: LogEntry, mapping: Mapping, file: Path) -> tuple[Traces, float, list[str]]:
    """The traces of all signals, the log's first time stamp [s], and what was done to the clocks.

    θ of the first joint comes first: its clock is the group's, its first instant the log's time zero.
    """
    traces: Traces = {}
    notes: list[str] = []
    from_bag = log.kind not in ("CSV", "Parquet", "MATLAB", "NumPy", "JSON", "Excel")
    clocks: dict[tuple[str, str], list[Array]] = {}  # rows in order, and their times
    origin: LogClock | None = None
    complete = _complete_rows(log, mapping, file)
    for joint, name, signal in sorted(mapping.signals(), key=lambda item: SIGNALS.index(item[1])):
        place = f"joints.{joint}.{name}"
        table = log.table_of(signal.column, file, place)
        clock = clock_of(log, table, signal.time, mapping.time, file, place)
        origin = origin or clock
        key = (clock.table, clock.name)
        if key not in clocks:
            seconds = clock.seconds(origin)
            called = clock.name or clock.table or "time"
            step = mapping.time.step
            *clocks[key], done = rows_in_order(seconds, called, from_bag, log.file, step, clock.logged)
            notes += done
        rows, time = clocks[key]
        raw = np.asarray(table.columns[signal.column], dtype=float)[rows]
        known, every = np.isfinite(raw), complete[table.name][rows]
        if signal.missing is not None:
            known &= raw != signal.missing
        if mapping.complete_rows:
            notes += [f'"{table.name or log.file.name}": rows that lack a signal are left out'] * (
                not every.all()
            )
            known &= every
        count = int(np.count_nonzero(known))
        if count < SHORTEST:
            found = f'"{signal.column}" has {count} values in {log.file.name}'
            raise InputError(f"{found}, expected at least {SHORTEST}", file=file, place=place)
        raw, time, rows = raw[known], time[known], rows[known]
        if signal.sign_bit is not None:
            raw = decoded(raw, signal.sign_bit, rows, signal.column, log.file)
        if signal.wrap is not None:
            raw = unwrapped(raw, signal.wrap, centred=isinstance(signal, TorqueColumn))
        if signal.fresh:
            new = np.concatenate([[True], np.diff(raw) != 0.0])
            raw, time, rows = raw[new], time[new], rows[new]
        factor = mapping.joints[joint].scale(signal)
        incomplete = ~complete[table.name][rows]
        traces[joint, name] = Trace(
            signal.column, clock.key, time, raw * factor if factor != 1.0 else raw, rows, factor,
            incomplete if incomplete.any() else None,
        )  # fmt: skip
    assert origin is not None
    return without_jumps(traces, entry, notes), float(origin.raw[0]) * origin.unit, notes


def decoded(raw: Array, bit: int, rows: Indices, column: str, file: Path) -> Array:
    """A register's numbers (N,) by their sign bit; negative ones have been decoded already.

    Raises:
        InputError: a number needs further bits, or is no whole one.
    """
    wrong = (raw >= 2.0 ** (bit + 1)) | ((raw >= 2.0**bit) & (raw != np.round(raw)))
    if wrong.any():
        k = int(np.argmax(wrong))
        message = (
            f"holds {number(raw[k], 12)}, expected a whole number below 2^{bit + 1} with sign_bit = {bit}"
        )
        raise InputError(message, file=file, place=f"row {rows[k] + 1}, column {column}")
    return sign_magnitude(raw, bit)


def _complete_rows(log: Log, mapping: Mapping, file: Path) -> dict[str, Bools]:
    """Table -> (N,) which of its rows have all of θ and τ that are taken from it."""
    complete: dict[str, Bools] = {}
    for joint, name, signal in mapping.signals():
        table = log.table_of(signal.column, file, f"joints.{joint}.{name}")
        known = np.isfinite(np.asarray(table.columns[signal.column], dtype=float))
        before = complete.get(table.name, np.ones(len(known), dtype=bool))
        complete[table.name] = before & known if name in mapping.needed else before
    return complete


def without_jumps(traces: Traces, entry: LogEntry, notes: list[str]) -> Traces:
    """The traces without the rows in which a position has jumped away and comes back, where that is asked."""
    if not entry.drop_jumps:
        return traces
    lost: dict[str, set[int]] = {}
    for (joint, name), trace in traces.items():
        if name == "theta":
            channel = Channel(name, joint, trace.time, trace.values)
            away, _ = outliers(channel)
            lost.setdefault(trace.clock, set()).update(trace.rows[away].tolist())
    kept: Traces = {}
    for key, trace in traces.items():
        keep = ~np.isin(trace.rows, list(lost.get(trace.clock, ())))
        changed = {name: getattr(trace, name)[keep] for name in ("time", "values", "rows")}
        incomplete = None if trace.incomplete is None else trace.incomplete[keep]
        kept[key] = replace(trace, **changed, incomplete=incomplete)
    notes += [
        f'"{clock}": {len(rows)} rows in which a position jumps are left out'
        for clock, rows in lost.items()
        if rows
    ]
    return kept


@dataclass(frozen=True, eq=False)
class AssembledGroup:
    """One group before it is written."""

    entry: LogEntry  # in the mapping
    kind: str  # of the log
    table: GroupTable  # its columns (N, n), time from 0
    traces: Traces
    zero: float  # [s] where the table's time 0 lies on the clock of the traces
    notes: tuple[str, ...]  # what was done to the data, one sentence each

    @property
    def origin(self) -> float:
        """First instant of the log on the clock of the traces [s]."""
        return float(next(iter(self.traces.values())).time[0])

    @property
    def since(self) -> float:
        """[s] from the log's first sample to the table's."""
        return self.zero - self.origin

    def uses(self, time: Array) -> Bools:
        """Which instants (N,) on the clock of the traces [s] are used."""
        return self.entry.uses(time - self.origin)


def assemble(log: Log, entry: LogEntry, mapping: Mapping, file: Path) -> AssembledGroup:
    """The group that `entry` asks for. Errors name the mapping `file` and the key, or the log and the row."""
    traces, stamp, notes = read_traces(log, entry, mapping, file)
    notes = [*log.notes, *notes]
    base = traces[mapping.names[0], "theta"]
    time = chosen_time(base, entry, log, file)
    if len(time) < len(base.time):
        first, last = (stamp + t for t in (time[0], time[-1]))
        notes.append(f"the part from time stamp {first:.12g} to {last:.12g} s is used")
    values: dict[tuple[str, str], Array] = {}
    keep = np.ones(len(time), dtype=bool)
    for key in (key for key in traces if key[1] in mapping.needed):
        joined = held if key[1] == "theta_ref" else needed
        values[key], usable = joined(traces[key], time, base, notes)
        keep &= usable
        if np.count_nonzero(keep) < SHORTEST:
            raise no_overlap(traces[key], base, log, file)
    for key in (key for key in traces if key[1] not in mapping.needed):
        column = optional(traces[key], time, notes)
        values |= {key: column} if column is not None else {}
    time = time[keep]
    columns = {name: at_joints(values, mapping, name, keep) for name in SIGNALS}
    if mapping.drive is not None:  # what drives the joints is how far the goal is ahead
        columns["tau"] = columns["theta_ref"] - columns["theta"]  # type: ignore[operator]
    zero = float(time[0])
    names = entry.group, entry.trajectory or entry.group, entry.payload
    columns |= {"validation": entry.validation, "temperature": entry.temperature, "kp_scale": entry.kp_scale}
    columns |= {"kind": entry.kind, "clamped": entry.clamped}
    table = GroupTable(*names, time - zero, **columns)  # type: ignore[arg-type]
    return AssembledGroup(entry, log.kind, table, traces, zero, tuple(dict.fromkeys(notes)))


def chosen_time(base: Trace, entry: LogEntry, log: Log, file: Path) -> Array:
    """(N,) the instants of θ between `from` and `to`."""
    time = base.time[entry.uses(base.time - base.time[0])]
    if len(time) < SHORTEST:
        span = f"from {entry.start:g} s" + ("" if entry.stop is None else f" to {entry.stop:g} s")
        found = f"{log.file.name} has {len(time)} samples {span}, expected at least {SHORTEST}"
        message = f"{found}; counted from its first sample it lasts {base.time[-1] - base.time[0]:.6g} s"
        raise InputError(message, file=file, place=f'log "{entry.group}"')
    return time


def needed(trace: Trace, time: Array, base: Trace, notes: list[str]) -> tuple[Array, Bools]:
    """A column that identification needs at `time` (N,), and where it has values."""
    if np.array_equal(trace.time, base.time):
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


def held(trace: Trace, time: Array, base: Trace, notes: list[str]) -> tuple[Array, Bools]:
    """The goal at `time` (N,), which holds until the next one is sent, and where there is one."""
    if not np.array_equal(trace.time, base.time):
        lacking = f"{len(base.time) - len(trace.time)} rows lack a goal" if trace.clock == base.clock else ""
        why = lacking or f'"{trace.clock}" has its own instants'
        notes.append(f'"{trace.column}": {why}; a goal holds until the next one')
    before = np.searchsorted(trace.time, time, side="right") - 1
    return trace.values[np.maximum(before, 0)], (before >= 0) & (time <= trace.reach[1])


def optional(trace: Trace, time: Array, notes: list[str]) -> Array | None:
    """A column for comparison at `time` (N,); None where it covers too little. It never changes the rows."""
    first, last = trace.reach
    outside = int(np.count_nonzero((time < first) | (time > last)))
    if outside > HELD_ENDS * len(time):
        share = 100 * (1 - outside / len(time))
        notes.append(f'"{trace.column}" covers {share:.0f} % of θ\'s time and is left out')
        return None
    if outside:
        notes.append(f'{outside} samples outside the time of "{trace.clock}" repeat its value at the end')
    return trace.at(np.clip(time, first, last))[0]


def no_overlap(trace: Trace, base: Trace, log: Log, file: Path) -> InputError:
    """The error for θ and τ that were not recorded at the same time, or whose clocks differ."""
    return InputError(
        f'in {log.file.name} "{trace.column}" runs from {trace.time[0]:.6g} s to {trace.time[-1]:.6g} s and '
        f'"{base.column}" from {base.time[0]:.6g} s to {base.time[-1]:.6g} s: they do not overlap, '
        f'expected clock = "log" (the time of recording) or shift."{trace.clock}" (seconds to add)',
        file=file,
        place="time",
    )


def at_joints(values: dict[tuple[str, str], Array], mapping: Mapping, name: str, keep: Bools) -> Array | None:
    """(N, n) a signal of all joints where `keep`, NaN for those without; None where no joint has it."""
    joints = mapping.names
    if not any((joint, name) in values for joint in joints):
        return None
    nothing = np.full(len(keep), np.nan)
    columns = np.stack([values.get((joint, name), nothing)[keep] for joint in joints], axis=1)
    if coupling := mapping.coupled(name):
        coupled = [joints.index(joint) for joint in coupling.joints]
        columns[:, coupled] = columns[:, coupled] @ coupling.turned(name)
    signals = (getattr(mapping.joints[joint], name) for joint in joints)
    offsets = np.array([signal.offset if signal else 0.0 for signal in signals])
    return columns + offsets if offsets.any() else columns
