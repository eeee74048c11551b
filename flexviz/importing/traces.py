"""One signal of one joint, as it is in the log made SI at the joint side, on its own clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.importing.clocks import Clock, clock_of, rows_in_order
from flexviz.importing.log import SHORTEST, Log
from flexviz.importing.mapping import Joint, Mapping, Signal, Torque
from flexviz.importing.units import ANGLE, CURRENT, TORQUE
from flexviz.measurements import GAP, POINTS, Array, interpolate

LONGER = 1.5  # own steps by which a signal may be continued beyond its first and last sample


@dataclass(frozen=True, eq=False)
class Trace:
    """A signal where it has values.

    Attributes:
        column: where it comes from.
        clock: what its clock is called (topic or time column).
        time: (N,) strictly increasing seconds after the log's first instant.
        values: (N,) [rad] or [Nm] at the joint side.
    """

    column: str
    clock: str
    time: Array
    values: Array

    @property
    def step(self) -> float:
        """Median step [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def reach(self) -> tuple[float, float]:
        """From when to when it is known or safely continued [s]."""
        beyond = LONGER * self.step
        return float(self.time[0]) - beyond, float(self.time[-1]) + beyond

    def shares_instants(self, other: Trace) -> bool:
        """Whether both have the same instants."""
        return self.time is other.time or np.array_equal(self.time, other.time)

    def at(self, wanted: Array) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Values at `wanted` (M,) [s], where the trace covers them, and where they lie in a gap of it.

        Polynomials through the six nearest samples; straight lines over a gap and beyond the ends.
        """
        first, last = self.reach
        covered = (wanted >= first) & (wanted <= last)
        after = np.clip(np.searchsorted(self.time, wanted), 1, len(self.time) - 1)
        width = self.time[after] - self.time[after - 1]
        inside = (wanted >= self.time[0]) & (wanted <= self.time[-1])
        gap = (
            inside
            & (width > GAP * self.step)
            & (wanted != self.time[after])
            & (wanted != self.time[after - 1])
        )
        slope = (self.values[after] - self.values[after - 1]) / width
        result = self.values[after - 1] + slope * (wanted - self.time[after - 1])
        smooth = inside & ~gap
        if len(self.time) >= POINTS and smooth.any():
            result[smooth] = interpolate(self.time, self.values, wanted[smooth])
        return result, covered, gap


class Tracer:
    """Makes traces of one log, each clock being looked at once."""

    def __init__(self, log: Log, mapping: Mapping, file: Path) -> None:
        self.log, self.mapping, self.file = log, mapping, file
        self.notes: list[str] = []
        self.from_bag = log.kind not in ("CSV", "Parquet", "MATLAB")
        self._clocks: dict[tuple[str, str], tuple[Clock, NDArray[np.intp], Array]] = {}
        self._origin: Clock | None = None

    def trace(self, joint: str, name: str, signal: Signal) -> Trace:
        """The signal called `name` of a joint; the first one asked for sets the log's time zero."""
        place = f"joints.{joint}.{name}"
        table = self.log.table_of(signal.column, self.file, place)
        clock = clock_of(self.log, table, signal.time, self.mapping.time, self.file, place)
        key = (clock.table, clock.name)
        if key not in self._clocks:
            self._origin = self._origin or clock
            seconds = clock.seconds(self._origin)
            rows, notes = rows_in_order(
                seconds, clock.name or clock.table or "time", self.from_bag, self.log.file
            )
            self.notes += notes
            self._clocks[key] = clock, rows, seconds[rows]
        clock, rows, time = self._clocks[key]
        raw = np.asarray(table.columns[signal.column], dtype=float)[rows]
        known = np.isfinite(raw)
        count = int(np.count_nonzero(known))
        if count < SHORTEST:
            raise InputError(
                f'"{signal.column}" has {count} values in {self.log.file.name}, {SHORTEST} are needed',
                file=self.file,
                place=place,
            )
        if not known.all():
            raw, time = raw[known], time[known]
        return Trace(signal.column, clock.key, time, to_joint_side(raw, signal, self.mapping.joints[joint]))


def to_joint_side(raw: Array, signal: Signal, joint: Joint) -> Array:
    """(N,) raw -> [rad] or [Nm] at the joint side: sign, unit, torque constant, gear, then the offset."""
    factor = float(signal.sign)
    if isinstance(signal, Torque):
        factor *= size_of(signal.unit, TORQUE | CURRENT)
        if signal.unit in CURRENT:
            factor *= joint.torque_constant or 1.0
        factor *= joint.gear if signal.side == "motor" else 1.0
    else:
        factor *= size_of(signal.unit, ANGLE)  # type: ignore[attr-defined]
        factor /= joint.gear if signal.side == "motor" else 1.0
    return raw * factor + signal.offset if factor != 1.0 or signal.offset else raw


def size_of(unit: str | float, known: dict[str, float]) -> float:
    """One unit in SI."""
    return known[unit] if isinstance(unit, str) else float(unit)
