"""Inspect logs and draft their mapping: by names, then by what the data show of units, signs and clocks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, count, islice
from pathlib import Path

import numpy as np

from flexviz.base.facts import Fact
from flexviz.base.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.checks import Issue
from flexviz.data.importing.correcting import correct
from flexviz.data.importing.draft import Draft, DraftJoint, Questions
from flexviz.data.importing.drafting_goals import alike_servos, goals_drive, leave_out_constant
from flexviz.data.importing.ready_mappings import Recognised, recognised
from flexviz.data.importing.torque_meaning import ask_for_meaning
from flexviz.data.logs import (
    EMPTY_FIELD,
    FORCE,
    LENGTH,
    LETTERS,
    NEEDED,
    SIGNALS,
    ColumnFamily,
    Log,
    LogSource,
    ReadOptions,
    candidates,
    coarse_clock,
    families_of,
    find_logs,
    guess_clocks,
    guess_unit,
    likely_clocks,
    open_run,
    reason_of,
)
from flexviz.data.measurements import Array, read_robot
from flexviz.robot.mounting import GRAVITY
from flexviz.robot.robot import Robot

INSPECTED_LOGS = 3  # that are read; importing finds where further ones differ
LISTED_COLUMNS = 60  # that were not recognised
TITLES = {
    "theta": "the motor position θ",
    "tau": "the motor torque τ (or the current)",
    "q": "the link position q (for comparison only)",
    "tau_joint": "the joint torque sensor (for comparison only)",
    "theta_ref": "the goal (reference) of θ",
}
STUBS = {  # what else its line may need
    "theta": 'unit = "deg" if not rad; from before the gear: side = "motor", and gear = its ratio',
    "tau": 'unit = "A" and torque_constant if a current; from before the gear: side = "motor", and gear',
}


@dataclass(frozen=True)
class Inspection:
    """A drafted mapping with its remaining issues."""

    draft: Draft
    issues: tuple[Issue, ...]


def inspect_logs(
    paths: Sequence[Path],
    robot: str,
    *,
    gravity: tuple[float, float, float] | None = None,
    questions: Questions | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Inspection:
    """Draft a mapping of the columns of logs; nothing is written.

    `robot` is a URDF's path, `example-robot-data:<name>` or `robots:<name>`; `gravity` (None: upright) is in
    its base's frame.
    """
    asked, gravity = questions or Questions(), gravity or GRAVITY
    sources = find_logs(paths)
    whole = read_robot(robot, None, Path.cwd(), Path("--robot"), gravity)
    options = ReadOptions(None, None, progress, should_stop)
    logs = [open_run(source, options) for source in sources[:INSPECTED_LOGS]]
    if together := paired(sources, logs[0], whole.joints, options):
        sources = together
        logs = [open_run(source, options) for source in sources[:INSPECTED_LOGS]]
    draft = Draft(robot, list(sources), group_names(sources), gravity=gravity)
    draft.seen = [*describe(logs[0]), *(f"  robot: {note}" for note in whole.notes)]
    families = families_of(logs[0], whole.joints)
    ready = recognised(logs[0], whole.joints)
    roles = choose_roles(families, asked, draft.seen) if ready is None else dict(ready.roles)
    draft.drive = goals_drive(roles, logs[0], draft)
    for name in (name for name in draft.needed if name not in roles):
        known = "; ".join(family.name for family in families[:12])
        together = f"; columns that belong together: {known}" if known else ""
        draft.missing.append(f"no columns were recognised as {TITLES[name]}{together}")
    used = [column for family in roles.values() for column in family.columns.values()]
    clock = ready_time(draft, logs[0], ready) or fill_time(draft, logs[0], used)
    if draft.missing:
        draft.seen += describe_unused(logs[0], [*used, str(draft.time.get("column", ""))])
    fill_joints(draft, roles, whole, clock, logs[0])
    if draft.drive:
        leave_out_constant(draft, sources, logs, options)
    if ready is not None and not draft.drive:
        tell_ready(draft, ready, asked)
    elif "tau" in roles and not draft.drive:
        ask_for_meaning(draft, roles, whole, logs[0], asked)
    ask_for_constants(draft, roles, asked)
    if len(sources) > 1:
        chosen = asked.several("Which groups are kept for validation, never fitted?", draft.groups)
        draft.validation = {draft.groups[i] for i in chosen}
    if draft.missing:
        return Inspection(draft, ())
    issues = tuple(correct(draft, logs, asked, progress, should_stop))
    draft.alike = alike_servos(list(draft.joints), whole) if draft.drive else []
    return Inspection(draft, issues)


def paired(
    sources: Sequence[LogSource], first: Log, joints: Sequence[str], options: ReadOptions
) -> list[LogSource]:
    """The sources with files that hold θ and τ, or goals, of the same runs put together; [] if they do not.

    Only where the `first` lacks one of both, and there are as many files of each kind (with equal columns).
    """

    def lacks_signal(log: Log, needed: Sequence[str] = NEEDED) -> bool:
        families = families_of(log, joints)
        return not all(candidates(families, name).families for name in needed)

    if len(sources) < 2 or sources[0].episode is not None or not lacks_signal(first):
        return []
    kinds: dict[tuple[str, ...], list[LogSource]] = {}
    for source in sources:
        kinds.setdefault(tuple(open_run(source, options).columns), []).append(source)
    runs = list(zip(*kinds.values(), strict=False))
    together = [LogSource(run[0].path, beside=tuple(other.path for other in run[1:])) for run in runs]
    whole = len(runs) * len(kinds) == len(sources) and 1 < len(kinds) <= len(LETTERS)
    if not whole:
        return []
    run = open_run(together[0], options)
    goals = ("theta", "theta_ref")
    complete = not lacks_signal(run) or (lacks_signal(first, goals) and not lacks_signal(run, goals))
    return together if complete else []


def fill_time(draft: Draft, log: Log, used: Sequence[str]) -> dict[str, str]:
    """Guess [time], of the widest table if no column is used; column -> its own time where it differs."""
    widest = max((list(table.columns) for table in log.tables), key=len, default=[])
    chosen = guess_clocks(log, used or widest[:1])
    if chosen is None and (coarse := coarse_clock(log.columns[(used or widest)[0]])):
        draft.time, draft.time_comment = coarse
    elif chosen is None:
        draft.missing.append("[time] column, or step = seconds from row to row: no column looks like a time")
    if not chosen:
        return {}
    most, _ = Counter(chosen.values()).most_common(1)[0]
    unit, draft.time_comment = guess_unit(log.columns[most], most)
    draft.time = {"column": most} | ({"unit": unit} if unit != "s" else {})
    return {column: time for column, time in chosen.items() if time != most}


def ready_time(draft: Draft, log: Log, ready: Recognised | None) -> dict[str, str]:
    """Fill in [time] as a ready mapping says; {} where it does not, or the log lacks the column."""
    time = ready.mapping.time if ready is not None else None
    column = next((x for x in log.columns if time and x.rpartition("/")[2] == time.column), None)
    if time is None or column is None or any(table.clock for table in log.tables):
        return {}
    draft.time = {"column": column} | ({"unit": time.unit} if time.unit != "s" else {})
    return {column: column}


def tell_ready(draft: Draft, ready: Recognised, asked: Questions) -> None:
    """Say what was recognised and what the torque is; ask for gears where it is before them."""
    draft.seen.append(f"  recognised: {ready.mapping.title}")
    torque = ready.torque
    if torque is None:
        return
    draft.seen.append(f"  its torque: {torque.means}")
    stated = all("unit" in joint.signals.get("tau", {}) for joint in draft.joints.values())
    if torque.needs and not stated:
        draft.missing.append(torque.needs)
    draft.torque = "joint" if torque.behind_gear else None
    for joint in draft.joints.values():
        joint.comment("tau", torque.means)
    if torque.side == "motor":
        gears = asked.numbers("gear ratio", len(draft.joints), signed=True)
        if gears is None:
            draft.missing.append("gear of every joint: the torque is before it")
        for joint, gear in zip(draft.joints.values(), gears or (), strict=False):
            joint.gear = gear


def group_names(sources: Sequence[LogSource]) -> list[str]:
    """A name for each group: the file's, with a number where it is taken; the episode's in a dataset."""
    names: list[str] = []
    for source in sources:
        base = source.path.stem if source.episode is None else f"episode{source.episode}"
        numbered = (f"{base}-{number}" for number in count(2))
        names.append(next(name for name in chain([base], numbered) if name not in names))
    return names


def describe(log: Log) -> list[str]:
    """Lines about a log."""
    lines = [f"Seen in {log.file.name} ({log.kind}):"]
    for table in log.tables:
        times = [table.clock] if table.clock else likely_clocks(table)[:1]
        span = ""
        if times and table.units.get(times[0]) == "ns":
            raw = table.columns[times[0]]
            seconds = float(raw[-1] - raw[0]) * 1e-9
            span = f", {(table.rows - 1) / max(seconds, 1e-9):.5g} Hz, {seconds:.5g} s"
        lines.append(f"  {table.name or 'one table'}: {table.rows} rows, {len(table.columns)} columns{span}")
    lines += [f"  {note}" for note in log.notes]
    odd = [f"{name}: {why}" for name, why in log.unusable.items() if not why.startswith(EMPTY_FIELD)]
    more = "; …" if len(odd) > 4 else ""
    return lines + ([f"  not usable: {'; '.join(odd[:4])}{more}"] if odd else [])


def describe_unused(log: Log, used: Sequence[str]) -> list[str]:
    """Lines about the columns that were not recognised."""
    left = {
        name: values
        for table in log.tables
        for name, values in table.columns.items()
        if name not in used and np.isfinite(values).any()
    }
    lines = [f"    {name}: {range_text(values)}" for name, values in islice(left.items(), LISTED_COLUMNS)]
    if len(left) > len(lines):
        lines.append(f"    … and {len(left) - len(lines)} more")
    return ["  columns that were not recognised:", *lines] if lines else []


def range_text(values: Array) -> str:
    return f"{np.nanmin(values):.4g} … {np.nanmax(values):.4g}"


def choose_roles(
    families: Sequence[ColumnFamily], asked: Questions, seen: list[str]
) -> dict[str, ColumnFamily]:
    """Signal -> family; those that nothing is known of are left out. `seen` is told what was ambiguous."""
    roles: dict[str, ColumnFamily] = {}
    for name in SIGNALS:
        found = candidates(families, name, list(roles.values()))
        needed = name in NEEDED
        options = found.families or (tuple(f for f in families if f not in roles.values()) if needed else ())
        if not options:
            continue
        if found.clear or (not needed and len(options) == 1):
            roles[name] = options[0]
            continue
        default = 0 if found.families else None
        described = [f"{f.name}  ({reason_of(f)})" for f in options]
        index = asked.choose(f"Which columns are {TITLES[name]}?", described, default)
        if index is not None:
            roles[name] = options[index]
            others = ", ".join(f.name for f in options if f is not options[index])
            seen += [f"  taken for {TITLES[name]}: {options[index].name}; others: {others}"] if others else []
    return roles


def fill_joints(
    draft: Draft, roles: dict[str, ColumnFamily], robot: Robot, own_times: dict[str, str], log: Log
) -> None:
    """An entry for every joint that θ and τ (where they were recognised) have."""
    needed = [set(roles[name].columns) for name in draft.needed if name in roles]
    covered = set.intersection(*needed) if needed else set(robot.joints)
    every = log.columns
    for joint in robot.joints if draft.drive else ():
        columns = {name: roles[name].columns.get(joint) for name in draft.needed if name in roles}
        if joint not in covered and any(columns.values()):
            lacks = tuple(name for name, column in columns.items() if column is None)
            only = tuple(column for column in columns.values() if column)
            fact = Fact("half-recorded", "odd", (joint,), columns=only, values={"lacks": lacks})
            draft.note(f"left out: {fact}")
    for joint in (joint for joint in robot.joints if joint in covered):
        entry = draft.joints[joint] = DraftJoint()
        for name, family in roles.items():
            column = family.columns.get(joint)
            if column is None:
                continue
            signal: dict[str, object] = {"from": column}
            signal |= {"time": own_times[column]} if column in own_times else {}
            unit = family.meaning.unit or ("A" if family.meaning.quantity == "current" else None)
            linear = robot.prismatic[robot.joints.index(joint)]
            unit = unit or (("m" if name not in ("tau", "tau_joint") else "N") if linear else None)
            if unit not in (None, "rad", "Nm") and (linear or unit not in LENGTH | FORCE):
                signal["unit"] = unit
            entry.signals[name] = signal | dict(family.stated)
            entry.comment(name, f"{range_text(every[column].columns[column])}; {reason_of(family)}")
        for name in (name for name in draft.needed if name not in roles):
            entry.comment(name, f'missing: {{ from = "column" }}; {STUBS[name]}')
    if not draft.joints:
        draft.missing.append(f"no joint has {' and '.join(TITLES[name] for name in draft.needed)}")


def ask_for_constants(draft: Draft, roles: dict[str, ColumnFamily], asked: Questions) -> None:
    """Ask for torque constants of currents: never guessed, because they set the scale of every result."""
    if "tau" not in roles or roles["tau"].meaning.quantity != "current":
        return
    joints = list(draft.joints)
    question = "τ is a current: torque constant [Nm/A], of the motor before the gear"
    constants = asked.numbers(question, len(joints))
    gears = asked.numbers("gear ratio", len(joints), signed=True) if constants else None
    if constants is None:
        other = f", {Fact('goals-instead')}" if "theta_ref" in roles else ""
        draft.missing.append(
            f"torque_constant [Nm/A] of every joint: τ is a current (motor's data sheet){other}"
        )
    for i, joint in enumerate(joints):
        entry = draft.joints[joint]
        entry.comment("torque_constant", "[Nm/A], on the side of tau")
        if constants is not None:
            entry.torque_constant = constants[i]
        if gears is not None and gears[i] != 1.0:
            entry.gear = gears[i]
            entry.signals["tau"]["side"] = "motor"
