"""One group as it is written: its table, and what the set says of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexviz.data.measurements import tables
from flexviz.data.measurements.data import OPTIONAL_SIGNALS, Array, Group
from flexviz.data.measurements.holds import HoldGroup
from flexviz.data.measurements.schema import Clamped, GroupKind


@dataclass(frozen=True, eq=False)
class GroupTable:
    """One group to write: N samples of n joints; a column that is all NaN is left out."""

    name: str
    trajectory: str
    payload: str
    time: Array  # (N,) [s]
    theta: Array  # (N, n) [rad], and so on
    tau: Array  # [Nm]
    q: Array | None = None  # [rad]
    tau_joint: Array | None = None  # [Nm]
    theta_ref: Array | None = None  # [rad]
    validation: bool = False
    temperature: Sequence[float] | Array | None = None  # (n,) or (1,) [°C]
    kp_scale: float = 1.0  # of the servos' gain
    file: str | None = None  # name of its table; None: `<name>.parquet` or `.csv`
    kind: GroupKind = "motion"
    clamped: Clamped = False  # of a static test
    recorded: Path | None = None  # the table itself, to be copied

    @staticmethod
    def of(group: Group) -> GroupTable:
        """A group that was read, with the signals that are used (jitter resampled)."""
        signals: dict[str, Any] = {name: group.joined(name) for name in ("time", "theta", "tau")}
        if len(group.segments) == 1 and len(signals["time"]) == len(group.time):
            signals["time"] = group.time  # as recorded: no rounding is added
        signals |= {name: group.at(name, signals["time"]) for name in OPTIONAL_SIGNALS}
        names = group.name, group.trajectory, group.payload
        signals |= {"validation": group.validation, "temperature": group.temperature}
        signals |= {"kp_scale": group.kp_scale}
        return GroupTable(*names, file=table_name(group.file), **signals)

    @staticmethod
    def of_holds(group: HoldGroup, joints: Sequence[str]) -> GroupTable:
        """A static test that was read; its table is copied."""
        clamped = [joint for joint, held in zip(joints, group.clamped, strict=True) if held]
        rest = group.holds.time, group.holds.theta, group.holds.tau
        return GroupTable(
            group.name, group.name, group.payload, *rest, file=table_name(group.file), kind="holds",
            clamped=clamped or False, recorded=group.file,
        )  # fmt: skip


def table_name(file: Path) -> str | None:
    """The name of a table that was read; None of arrays."""
    return file.name if file.suffix.lower() in tables.SUFFIXES else None
