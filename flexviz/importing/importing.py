"""Make a measurement set of the logs that a mapping names: all of it or nothing."""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.errors import InputError
from flexviz.importing.assembling import Assembled, assemble
from flexviz.importing.checking import check_groups, payload_bodies
from flexviz.importing.delays import DelayEstimate, suspicious_delay, torque_delay
from flexviz.importing.log import Reading
from flexviz.importing.mapping import Mapping, read_mapping
from flexviz.importing.offsets import ClockOffset, clock_offsets
from flexviz.importing.robots import files_of
from flexviz.importing.sources import open_log
from flexviz.importing.suspicion import Suspicion
from flexviz.measurements import (
    GroupTable,
    MeasurementSet,
    check_free,
    read_robot,
    read_set,
    sample_motion,
    write_set,
    wrong_time_unit,
)
from flexviz.progress import Progress, ProgressCallback, StopCallback, ignore, never, part

FORMAT = 1  # of the report as JSON


@dataclass(frozen=True)
class Imported:
    """What an import did.

    Attributes:
        folder: the set that was written; None where something is wrong or nothing was asked to be written.
        mapping: the mapping file.
        joints: the set's joints.
        groups: the groups with what was done to their data.
        offsets: of the clocks of link positions, after the mapping's shifts.
        delay: how torque and motion agree in time; None where it does not show.
        suspicions: what looks wrong or odd.
        warnings: what reading the new set found odd.
    """

    folder: Path | None
    mapping: str
    joints: tuple[str, ...]
    groups: tuple[Assembled, ...]
    offsets: tuple[ClockOffset, ...]
    delay: DelayEstimate | None
    suspicions: tuple[Suspicion, ...]
    warnings: tuple[str, ...]

    @property
    def wrong(self) -> tuple[Suspicion, ...]:
        """Suspicions that keep the set from being written."""
        return tuple(s for s in self.suspicions if s.severity == "wrong")

    def to_json(self) -> dict[str, Any]:
        """The report as plain data; times in s."""
        return {
            "format": FORMAT,
            "set": None if self.folder is None else str(self.folder),
            "mapping": self.mapping,
            "joints": list(self.joints),
            "groups": [
                {
                    "name": group.entry.group,
                    "log": group.entry.file,
                    "episode": group.entry.episode,
                    "kind": group.log,
                    "payload": group.entry.payload,
                    "validation": group.entry.validation,
                    "samples": len(group.table.time),
                    "step": float(np.median(np.diff(group.table.time))),
                    "duration": float(group.table.time[-1]),
                    "notes": list(group.notes),
                }
                for group in self.groups
            ],
            "clock_offsets": [
                {"group": o.group, "clock": o.clock, "base": o.base, "delay": o.delay, "std": o.std}
                for o in self.offsets
            ],
            "torque_delay": None
            if self.delay is None
            else {"delay": self.delay.seconds, "std": self.delay.std},
            "suspicions": [
                {
                    "kind": s.kind,
                    "severity": s.severity,
                    "joints": list(s.joints),
                    "signal": s.signal,
                    "message": s.message,
                    "fixes": [
                        {"joint": f.joint, "signal": f.signal, "key": f.key, "value": f.value}
                        for f in s.fixes
                    ],
                }
                for s in self.suspicions
            ],
            "warnings": list(self.warnings),
        }


def import_logs(
    file: str | Path,
    out: str | Path | None,
    *,
    table_format: str = "parquet",
    accept: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Imported:
    """Import what the mapping `file` names into the folder `out`.

    Args:
        out: a new or empty folder; None: only check.
        accept: write the set although something looks wrong; what cannot be a measurement set is still
            refused.
    """
    file = Path(file)
    return import_mapping(read_mapping(file), file, out, table_format, accept, progress, should_stop)


def import_mapping(
    mapping: Mapping,
    file: Path,
    out: str | Path | None,
    table_format: str = "parquet",
    accept: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Imported:
    """As `import_logs`, for a mapping that was read; its paths are relative to the folder of `file`."""
    target = None if out is None else Path(out).absolute()
    if target is not None:
        check_free(target)
    folder = file.absolute().parent
    robot = read_robot(mapping.robot, mapping.names, folder, file)
    payload_bodies(mapping, robot, file)
    groups = read_groups(mapping, file, folder, progress, should_stop)
    progress(Progress("comparing with the robot", 0.0))
    found = check_groups(mapping, robot, groups, file)
    offsets = [o for g in groups for o in clock_offsets(g.entry.group, g.traces, mapping.names)]
    found += suspicious_offsets(offsets, mapping)
    done = Imported(None, str(file), mapping.names, tuple(groups), tuple(offsets), None, tuple(found), ())
    if done.wrong and not accept:
        return done
    where = Path(tempfile.gettempdir()) if target is None else target.parent
    try:
        where.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".flexviz-import-", dir=where) as temporary:
            source, files, notes = files_of(robot)
            new = Path(temporary) / (target.name if target else file.stem)
            progress(Progress("writing", 0.0))
            Reading(should_stop=should_stop).check_stop()
            write_set(
                new,
                robot=source,
                joints=mapping.names,
                groups=[group.table for group in groups],
                payloads={"none": (), **payload_bodies(mapping, robot, file)},
                torque_hold=mapping.torque_hold,
                initial_stiffness=mapping.initial.stiffness,
                initial_motor_inertia=mapping.initial.motor_inertia,
                kp=mapping.controller.kp if mapping.controller else None,
                kd=mapping.controller.kd if mapping.controller else None,
                effects=mapping.model.effects,
                files=files,
                table_format=table_format,
            )
            measurements = read_back(new, target or Path(file.stem))
            misfit = any(s.kind in ("unit", "sign", "zero", "unexplained") for s in found)
            delay = None  # a model of something else has delays of its own
            if not misfit:
                delay = torque_delay(measurements, progress, should_stop)
            Reading(should_stop=should_stop).check_stop()
            late = suspicious_delay(delay, measurements) if delay is not None else []
            warnings = [*notes, *measurements.warnings]
            done = replace(done, delay=delay, suspicions=(*found, *late), warnings=tuple(warnings))
            if target is not None:
                os.replace(new, target)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=target) from None
    return replace(done, folder=target)


def read_groups(
    mapping: Mapping, file: Path, folder: Path, progress: ProgressCallback, should_stop: StopCallback
) -> list[Assembled]:
    """Every log as a group."""
    wanted = {signal.column for _, _, signal in mapping.signals()}
    wanted |= {signal.time for _, _, signal in mapping.signals() if signal.time}
    wanted |= {mapping.time.column} if mapping.time.column else set()
    groups = []
    for i, entry in enumerate(mapping.logs):
        count = len(mapping.logs)
        told = part(progress, i / count, (i + 1) / count)
        path = folder / entry.file
        try:
            log = open_log(path, Reading(wanted, entry.episode, told, should_stop))
        except InputError as error:
            if error.message != "file not found":
                raise
            place = f'log {i + 1} "{entry.group}", file'
            raise InputError(f'"{entry.file}" does not exist', file=file, place=place) from None
        Reading(should_stop=should_stop).check_stop()
        groups.append(assemble(log, entry, mapping, file))
        if mapping.time.column is not None and mapping.time.unit == "s":
            check_time(groups[-1].table, path, file)
    return groups


def check_time(table: GroupTable, log: Path, file: Path) -> None:
    """Refuse a time that is not in seconds, naming the key of the mapping that says so."""
    step = float(np.median(np.diff(table.time)))
    speed = float(np.max(np.abs(sample_motion(table.time, table.theta, table.tau).v)))
    if unit := wrong_time_unit(step, speed):
        short = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}[unit]
        raise InputError(
            f"the median step of {log.name} is {step:g}: is its time in {unit}? "
            f'unit = "{short}" would be right',
            file=file,
            place="time.unit",
        )


def suspicious_offsets(offsets: list[ClockOffset], mapping: Mapping) -> list[Suspicion]:
    """Clocks of link positions that are off by more than a spring and friction explain."""
    found = []
    for offset in offsets:
        if abs(offset.delay) < max(2e-3, 3 * offset.std):
            continue
        total = mapping.time.shift.get(offset.clock, 0.0) - offset.delay
        message = (
            f'in {offset.group} the clock of "{offset.clock}" is {1e3 * abs(offset.delay):.4g} ± '
            f"{1.96e3 * offset.std:.2g} ms {'behind' if offset.delay > 0 else 'ahead of'} that of theta; "
            f'[time] shift."{offset.clock}" = {total:.6g} would correct it'
        )
        found.append(Suspicion("clock", "odd", mapping.names, "q", message))
    return found


def read_back(new: Path, target: Path) -> MeasurementSet:
    """Read the set that was written, errors and warnings naming the place where it will be."""
    try:
        with quiet("flexviz.measurements"):
            measurements = read_set(new)
    except InputError as error:
        text = error.message.replace(str(new), str(target))
        where = None if error.file is None else error.file.replace(str(new.resolve()), str(target))
        raise InputError(text, file=where, place=error.place) from None
    warnings = tuple(w.replace(str(new.resolve()), str(target)) for w in measurements.warnings)
    return replace(measurements, warnings=warnings)


@contextmanager
def quiet(name: str) -> Iterator[None]:
    """Nothing is logged under this name: it would show a place that is about to vanish."""
    logger = logging.getLogger(name)
    before = logger.disabled
    logger.disabled = True
    try:
        yield
    finally:
        logger.disabled = before
