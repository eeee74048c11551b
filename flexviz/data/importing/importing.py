"""Make a measurement set of the logs that a mapping names: all of it or nothing."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.files import named_errors, temporary_folder, whole_folder
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never, part
from flexviz.checks import SPOILT, Issue, behind_gear
from flexviz.data.importing.checking import check_all
from flexviz.data.importing.delays import (
    ClockOffset,
    DelayEstimate,
    clock_offsets,
    delay_issues,
    torque_delay,
)
from flexviz.data.importing.goals import GoalFault, constant_goals, goal_faults
from flexviz.data.logs import (
    AssembledGroup,
    CoarseClock,
    LogSource,
    Mapping,
    ReadOptions,
    assemble,
    check_stop,
    open_run,
    parse_mapping,
    proposed,
    read_mapping,
)
from flexviz.data.measurements import (
    GroupTable,
    MeasurementSet,
    check_free,
    read_payloads,
    read_robot,
    read_set,
    robot_files,
    sample_motion,
    write_set,
    wrong_time_unit,
)
from flexviz.robot.robot import PayloadBody, Robot

FORMAT = 1  # of the report as JSON
MOST_ROUNDS = 4  # of mending: one repair may show what another finding has hidden
# with such an issue the torque's delay proves nothing
ABOUT_UNITS = ("unit", "sign", "zero", "coupling", "unexplained", *SPOILT, "held")


@dataclass(frozen=True)
class Imported:
    """Report of an import."""

    folder: Path | None  # the set that was written; None where something is wrong, and after a check
    mapping: str  # the mapping file
    joints: tuple[str, ...]
    groups: tuple[AssembledGroup, ...]  # with notes on their data
    offsets: tuple[ClockOffset, ...]  # of the clocks of link positions, after the mapping's shifts
    delay: DelayEstimate | None  # of the torque against the motion; None where it cannot be told
    issues: tuple[Issue, ...]
    warnings: tuple[Fact, ...]  # from reading the new set
    mended: tuple[str, ...] = ()  # keys that were set as proposed

    @property
    def wrong(self) -> tuple[Issue, ...]:
        """Issues that keep the set from being written."""
        return tuple(issue for issue in self.issues if issue.severity == "wrong")

    def to_json(self) -> dict[str, Any]:
        """The report as plain data; times in s."""
        groups = [
            {
                "name": group.entry.group,
                "log": group.entry.label,
                "episode": group.entry.episode,
                "kind": group.kind,
                "payload": group.entry.payload,
                "validation": group.entry.validation,
                "samples": len(group.table.time),
                "step": float(np.median(np.diff(group.table.time))),
                "duration": float(group.table.time[-1]),
                "notes": list(group.notes),
            }
            for group in self.groups
        ]
        delay = None if self.delay is None else {"delay": self.delay.seconds, "std": self.delay.std}
        return {
            "format": FORMAT,
            "set": None if self.folder is None else str(self.folder),
            "mapping": self.mapping,
            "joints": list(self.joints),
            "groups": groups,
            "clock_offsets": [asdict(offset) for offset in self.offsets],
            "torque_delay": delay,
            "suspicions": [issue_json(issue) for issue in self.issues],
            "mended": list(self.mended),
            "warnings": list(map(str, self.warnings)),
        }


def import_logs(
    file: str | Path,
    out: str | Path | None,
    *,
    mapping: Mapping | None = None,
    table_format: str = "parquet",
    accept: bool = False,
    mend: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Imported:
    """Import the logs that the mapping `file` names into the folder `out`.

    Args:
        file: the mapping; its paths are relative to its folder.
        out: a new or empty folder; None: only check.
        mapping: the content of `file`, where it was read already.
        table_format: "parquet" or "csv".
        accept: write the set although something looks wrong; data that cannot be a set are still refused.
        mend: set the keys that are proposed.
        progress, should_stop: see flexviz.base.progress.
    """
    file = Path(file)
    mapping = mapping or read_mapping(file)
    target = None if out is None else Path(os.path.abspath(out))
    if target is not None:
        check_free(target)
    folder = file.absolute().parent
    robot = read_robot(mapping.robot, mapping.names, folder, file, mapping.gravity)
    mapping = mapping.for_joints(robot.prismatic, file)
    payloads = {"none": (), **read_payloads(mapping, robot, file)}  # refuses wrong ones before logs are read
    mapping, groups, found, mended = read_and_check(
        mapping, robot, payloads, file, mend, progress, should_stop
    )
    offsets = [o for g in groups for o in clock_offsets(g.entry.group, g.traces, mapping.names)]
    found += offset_issues(offsets, mapping)
    done = Imported(
        None, str(file), mapping.names, tuple(groups), tuple(offsets), None, tuple(found), (), mended
    )
    if done.wrong and not accept:
        return done
    place = whole_folder(target) if target else temporary_folder("import")
    with named_errors(target), place as new:
        progress(Progress("writing", 0.0))
        check_stop(should_stop)
        notes = write_groups(new, mapping, robot, payloads, groups, table_format)
        measurements = read_back(new, target or Path(file.stem))
        delay = None
        if mapping.drive is None and not any(issue.kind in ABOUT_UNITS for issue in found):
            delay = torque_delay(measurements, progress, should_stop)
        check_stop(should_stop)
    late = delay_issues(delay, measurements) if delay is not None else []
    if mapping.drive is None and behind_gear(measurements):
        notes.append(Fact("behind-gear", values={"stated": mapping.torque is not None}))
    warnings = (*notes, *measurements.warnings)
    return replace(done, folder=target, delay=delay, issues=(*found, *late), warnings=warnings)


def read_and_check(
    mapping: Mapping,
    robot: Robot,
    payloads: dict[str, tuple[PayloadBody, ...]],
    file: Path,
    mend: bool,
    progress: ProgressCallback,
    should_stop: StopCallback,
) -> tuple[Mapping, list[AssembledGroup], list[Issue], tuple[str, ...]]:
    """The mapping, mended if asked, its groups, their issues, and the keys that were set."""
    mended: list[str] = []
    faults: list[GoalFault] = []
    for _ in range(MOST_ROUNDS):
        try:
            groups = read_groups(mapping, file, file.absolute().parent, progress, should_stop)
            progress(Progress("comparing with the robot", 0.0))
            found = check_all(mapping, robot, payloads, groups)
            if mapping.drive is not None:
                faults = [*constant_goals(mapping, groups), *goal_faults(mapping, robot, groups)]
            proposals = [proposal for one in (*found, *faults) for proposal in one.proposals]
        except CoarseClock as error:
            if not mend or error.proposal is None or str(error.proposal) in mended:
                raise
            proposals = [error.proposal]
        keys = dict.fromkeys(map(str, proposals))
        if not mend or set(keys) <= set(mended):
            break
        mended += [text for text in keys if text not in mended]
        document = mapping.model_dump(by_alias=True, exclude_unset=True, mode="json")
        document = proposed(document, proposals)
        mapping = parse_mapping(document, file).for_joints(robot.prismatic, file)
        robot = robot.mounted(mapping.gravity or robot.gravity)
    for fault in faults:
        raise fault.error()
    return mapping, groups, found, tuple(mended)  # type: ignore[possibly-unbound]


def read_groups(
    mapping: Mapping, file: Path, folder: Path, progress: ProgressCallback, should_stop: StopCallback
) -> list[AssembledGroup]:
    """Every log as a group."""
    signals = [signal for _, _, signal in mapping.signals()]
    times = {signal.time for signal in signals} | {mapping.time.column}
    wanted = {signal.column for signal in signals} | {time for time in times if time is not None}
    groups, count = list[AssembledGroup](), len(mapping.logs)
    for i, entry in enumerate(mapping.logs):
        options = ReadOptions(wanted, None, part(progress, i / count, (i + 1) / count), should_stop)
        try:
            first, *beside = (folder / name for name in entry.files)
            log = open_run(LogSource(first, entry.episode, tuple(beside)), options)
        except InputError as error:
            if error.message != "file not found":
                raise
            place = f'log {i + 1} "{entry.group}", file'
            missing = next(name for name in entry.files if not (folder / name).exists())
            raise InputError(f'"{missing}" does not exist', file=file, place=place) from None
        check_stop(should_stop)
        groups.append(assemble(log, entry, mapping, file))
        if mapping.time.column is not None and mapping.time.unit == "s":
            check_time(groups[-1].table, log.file, file)
    return groups


def check_time(table: GroupTable, log: Path, file: Path) -> None:
    """Refuse a time that is not in seconds, naming its key in the mapping."""
    step = float(np.median(np.diff(table.time)))
    speed = float(np.max(np.abs(sample_motion(table.time, table.theta, table.tau).v)))
    if unit := wrong_time_unit(step, speed):
        short = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}[unit]
        found = f"the median step of {log.name} is {step:g}: is its time in {unit}?"
        raise InputError(f'{found} expected unit = "{short}"', file=file, place="time.unit")


def offset_issues(offsets: list[ClockOffset], mapping: Mapping) -> list[Issue]:
    """Clocks of link positions that are off by more than a spring and friction explain."""
    found = []
    for offset in offsets:
        if not offset.significant:
            continue
        total = mapping.time.shift.get(offset.clock, 0.0) - offset.delay
        values = {"group": offset.group, "clock": offset.clock, "text": offset.text, "shift": total}
        found.append(Issue("clock", "odd", mapping.names, "q", values))
    return found


def write_groups(
    new: Path,
    mapping: Mapping,
    robot: Robot,
    payloads: dict[str, tuple[PayloadBody, ...]],
    groups: list[AssembledGroup],
    table_format: str,
) -> list[Fact]:
    """Write the set into the folder `new`; notes on what its robot lacks."""
    source, files, notes = robot_files(robot)
    tables = [group.table for group in groups]
    if mapping.drive is not None:
        tables = [replace(table, tau=np.full_like(table.tau, np.nan)) for table in tables]
    write_set(
        new,
        robot=source,
        gravity=mapping.gravity,
        joints=mapping.names,
        groups=tables,
        payloads=payloads,
        torque_hold=mapping.torque_hold,
        date=mapping.date,
        torque=mapping.torque,
        initial_stiffness=mapping.initial.stiffness,
        initial_motor_inertia=mapping.initial.motor_inertia,
        kp=mapping.controller.kp if mapping.controller else None,
        kd=mapping.controller.kd if mapping.controller else None,
        effects=mapping.model.effects,
        rigid=mapping.model.rigid,
        no_torque=mapping.model.no_torque,
        drive=mapping.drive and mapping.drive.model_dump(by_alias=True, exclude_defaults=True),
        files=files,
        table_format=table_format,
    )
    return notes


def read_back(new: Path, target: Path) -> MeasurementSet:
    """Read the set that was written; errors and warnings name its final place."""
    place = str(new.resolve())
    try:
        measurements = read_set(new, logged=False)
    except InputError as error:
        file = None if error.file is None else error.file.replace(place, str(target))
        message = error.message.replace(str(new), str(target))
        raise InputError(message, file=file, place=error.place) from None
    warnings = tuple(named_at(warning, place, str(target)) for warning in measurements.warnings)
    return replace(measurements, warnings=warnings)


def named_at(fact: Fact, place: str, target: str) -> Fact:
    """A fact whose files are in `target` instead of `place`."""
    files = tuple(str(file).replace(place, target) for file in fact.values.get("files", ()))
    values = {**fact.values, **({"files": files} if files else {})}
    return replace(fact, file=fact.file.replace(place, target), values=values)


def issue_json(issue: Issue) -> dict[str, Any]:
    """An issue as plain data, and in words."""
    return {
        "kind": issue.kind,
        "severity": issue.severity,
        "joints": list(issue.joints),
        "signal": issue.signal,
        "message": issue.message,
        "values": dict(issue.values),
        "fixes": [asdict(fix) for fix in issue.fixes],
        "proposals": [asdict(proposal) for proposal in issue.proposals],
    }
