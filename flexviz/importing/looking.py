"""Look at logs and write down what their columns are: by names first, then by what the data say about units,
signs, gear and clocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from flexviz.importing.assembling import Assembled, assemble
from flexviz.importing.checking import check_groups
from flexviz.importing.clocks import likely_clocks
from flexviz.importing.draft import Draft, DraftJoint
from flexviz.importing.families import Family
from flexviz.importing.guessing import candidates, families_of, reason
from flexviz.importing.log import EMPTY, Log, Reading
from flexviz.importing.offsets import ClockOffset, clock_offsets
from flexviz.importing.pairing import scale_pairs
from flexviz.importing.questions import Questions, Silent
from flexviz.importing.sources import Source, find_sources, open_log
from flexviz.importing.suspicion import Suspicion
from flexviz.importing.times import guess_time
from flexviz.measurements import read_robot
from flexviz.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.robot import Robot

MOST_LOOKED = (
    3  # logs that are read; the others are taken to be alike, and importing finds where they are not
)
MOST_NAMED = 60  # columns that were not recognised and are listed
ROUNDS = 4  # of correcting what the data contradict
SHIFTED = 2e-3  # [s] a smaller offset of the link clock is not corrected
TITLES = {
    "theta": "the motor position θ",
    "tau": "the motor torque τ (or the current)",
    "q": "the link position q (for comparison only)",
    "tau_joint": "the joint torque sensor (for comparison only)",
    "theta_ref": "the reference of θ (for replay only)",
}


@dataclass(frozen=True)
class Looked:
    """What looking at logs gave.

    Attributes:
        draft: the mapping to be.
        suspicions: what still looks wrong, or odd.
        offsets: of the clocks, as they were before the draft corrected them.
    """

    draft: Draft
    suspicions: tuple[Suspicion, ...]
    offsets: tuple[ClockOffset, ...]


def look(
    paths: Sequence[Path],
    robot: str,
    *,
    questions: Questions | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Looked:
    """Guess what the columns of logs are.

    `robot` is a URDF's path, `example-robot-data:<name>` or `robots:<name>`. Nothing is written.
    """
    asked = questions or Silent()
    sources = find_sources(paths)
    whole = read_robot(robot, None, Path.cwd(), Path("--robot"))
    logs = [
        open_log(source.path, Reading(None, source.episode, progress, should_stop))
        for source in sources[:MOST_LOOKED]
    ]
    draft = Draft(robot, list(sources), group_names(sources))
    draft.seen = seen_in(logs[0])
    families = families_of(logs[0], whole.joints)
    roles = choose_roles(families, asked)
    for name in ("theta", "tau"):
        if name not in roles:
            known = "; ".join(family.name for family in families[:12])
            together = f"; columns that belong together: {known}" if known else ""
            draft.missing.append(f"no columns were recognised as {TITLES[name]}{together}")
    used = [column for family in roles.values() for column in family.columns.values()]
    if draft.missing:
        draft.seen += left_in(logs[0], used)
    # where nothing was recognised, the signals are likely in the table with the most columns
    widest = max((list(table.columns) for table in logs[0].tables), key=len, default=[])
    draft.time, draft.time_comment, own_times = guess_time(logs[0], used or widest[:1])
    if draft.time_comment.startswith("MISSING"):
        draft.missing.append(draft.time_comment.removeprefix("MISSING: "))
        draft.time_comment = ""
    fill_joints(draft, roles, whole, own_times, logs[0])
    ask_about_sides(draft, roles, asked)
    if len(sources) > 1:
        chosen = asked.several("Which groups are kept for validation, never fitted?", draft.groups)
        draft.validation = {draft.groups[i] for i in chosen}
    if draft.missing:
        return Looked(draft, (), ())
    return correct(draft, logs, asked, progress, should_stop)


def group_names(sources: Sequence[Source]) -> list[str]:
    """A name for each group: the file's, with a number where it is taken; the episode's in a dataset."""
    names: list[str] = []
    for source in sources:
        name = source.path.stem if source.episode is None else f"episode{source.episode}"
        number = 2
        base = name
        while name in names:
            name, number = f"{base}-{number}", number + 1
        names.append(name)
    return names


def seen_in(log: Log) -> list[str]:
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
    odd = [f"{name}: {why}" for name, why in log.unusable.items() if not why.startswith(EMPTY)]
    if odd:
        lines.append(f"  not usable: {'; '.join(odd[:4])}{'; …' if len(odd) > 4 else ''}")
    return lines


def left_in(log: Log, used: Sequence[str]) -> list[str]:
    """Lines about the columns that nothing is known of, for who fills in the mapping."""
    left = {
        name: values
        for table in log.tables
        for name, values in table.columns.items()
        if name not in used and np.isfinite(values).any()
    }
    lines = [
        f"    {name}: {np.nanmin(values):.4g} … {np.nanmax(values):.4g}"
        for name, values in islice(left.items(), MOST_NAMED)
    ]
    if len(left) > len(lines):
        lines.append(f"    … and {len(left) - len(lines)} more")
    return ["  columns that were not recognised:", *lines] if lines else []


def choose_roles(families: Sequence[Family], asked: Questions) -> dict[str, Family]:
    """Signal -> family; those that nothing is known of are left out."""
    roles: dict[str, Family] = {}
    for name in ("theta", "tau", "q", "tau_joint", "theta_ref"):
        found = candidates(families, name, list(roles.values()))
        needed = name in ("theta", "tau")
        options = found.families or (tuple(f for f in families if f not in roles.values()) if needed else ())
        if not options:
            continue
        if found.clear or (not needed and len(options) == 1):
            roles[name] = options[0]
            continue
        default = 0 if found.families else None
        index = asked.choose(
            f"Which columns are {TITLES[name]}?", [f"{f.name}  ({reason(f)})" for f in options], default
        )
        if index is not None:
            roles[name] = options[index]
    return roles


def fill_joints(
    draft: Draft, roles: dict[str, Family], robot: Robot, own_times: dict[str, str], log: Log
) -> None:
    """An entry for every joint that θ and τ (where they were recognised) have."""
    needed = [set(roles[name].columns) for name in ("theta", "tau") if name in roles]
    covered = set.intersection(*needed) if needed else set(robot.joints)
    every = log.columns
    for joint in (joint for joint in robot.joints if joint in covered):
        entry = draft.joints[joint] = DraftJoint()
        for name, family in roles.items():
            column = family.columns.get(joint)
            if column is None:
                continue
            signal: dict[str, object] = {"from": column}
            signal |= {"time": own_times[column]} if column in own_times else {}
            unit = family.meaning.unit or ("A" if family.meaning.quantity == "current" else None)
            if unit is not None and unit not in ("rad", "Nm"):
                signal["unit"] = unit
            entry.signals[name] = signal
            values = every[column].columns[column]
            entry.say(name, f"{np.nanmin(values):.4g} … {np.nanmax(values):.4g}; {reason(family)}")
        for name in ("theta", "tau"):
            if name not in roles:
                entry.say(name, 'missing: { from = "column" }')
    if not draft.joints:
        draft.missing.append("no joint has both θ and τ")


def ask_about_sides(draft: Draft, roles: dict[str, Family], asked: Questions) -> None:
    """Torque constants of currents; they are never guessed, for they set the scale of every result."""
    if "tau" not in roles or roles["tau"].meaning.quantity != "current":
        return
    joints = list(draft.joints)
    question = "τ is a current: torque constant [Nm/A], of the motor before the gear"
    constants = asked.numbers(question, len(joints), None)
    gears = asked.numbers("gear ratio", len(joints), None) if constants else None
    if constants is None:
        draft.missing.append(
            "torque_constant [Nm/A] of every joint: τ is a current (data sheet of the motor)"
        )
    for i, joint in enumerate(joints):
        entry = draft.joints[joint]
        entry.say("torque_constant", "[Nm/A], on the side that tau's side says")
        if constants is not None:
            entry.torque_constant = constants[i]
        if gears is not None and gears[i] != 1.0:
            entry.gear = gears[i]
            entry.signals["tau"]["side"] = "motor"


def correct(
    draft: Draft, logs: Sequence[Log], asked: Questions, progress: ProgressCallback, should_stop: StopCallback
) -> Looked:
    """Let the data correct units, sides, signs and clocks, and note what remains."""
    used = Robot.load(draft.robot, tuple(draft.joints))
    offsets: tuple[ClockOffset, ...] = ()
    remaining: list[Suspicion] = []
    for round_ in range(ROUNDS):
        progress(Progress("comparing with the robot", round_ / ROUNDS))
        if should_stop():
            Reading(should_stop=should_stop).check_stop()
        mapping = draft.mapping()
        groups = [
            assemble(log, entry, mapping, Path("mapping"))
            for log, entry in zip(logs, mapping.logs, strict=False)
        ]
        if round_ == 0:
            offsets = shift_clocks(draft, groups)
        if scale_pairs(draft, used, groups):
            continue
        remaining = check_groups(mapping, used, groups, guessed=True)
        certain = [s for s in remaining if s.severity == "wrong" and s.fixes]
        for suspicion in certain:
            draft.apply(suspicion.fixes, suspicion.message)
        if not certain and not ask_about_scales(draft, remaining, asked):
            break
    return Looked(draft, tuple(remaining), offsets)


def ask_about_scales(draft: Draft, remaining: Sequence[Suspicion], asked: Questions) -> bool:
    """Ask for gears and torque constants that the data only hint at; whether an answer changed anything."""
    unknown = [(s.signal, joint) for s in remaining if s.kind == "unit" and not s.fixes for joint in s.joints]
    far = [joint for signal, joint in unknown if signal == "theta" and draft.joints[joint].gear == 1.0]
    weak = [
        joint
        for signal, joint in unknown
        if signal == "tau" and "unit" not in draft.joints[joint].signals["tau"]
    ]
    if far:
        ratios = asked.numbers(f"gear ratio of {', '.join(far)}: theta turns too far", len(far), None)
        for joint, ratio in zip(far, ratios or (), strict=False):
            draft.joints[joint].gear = ratio
            draft.joints[joint].signals["theta"]["side"] = "motor"
        return ratios is not None and set(ratios) != {1.0}
    if weak:
        question = f"tau of {', '.join(weak)} has no torque's size. Is it a current? Torque constant [Nm/A]"
        constants = asked.numbers(question, len(weak), None)
        for joint, constant in zip(weak, constants or (), strict=False):
            entry = draft.joints[joint]
            entry.torque_constant = constant
            entry.signals["tau"] |= {"unit": "A"} | ({"side": "motor"} if entry.gear != 1.0 else {})
        return constants is not None
    return False


def shift_clocks(draft: Draft, groups: Sequence[Assembled]) -> tuple[ClockOffset, ...]:
    """Correct the clocks of link positions by what the first log says; what all of them say."""
    found = [clock_offsets(g.entry.group, g.traces, tuple(draft.joints)) for g in groups]
    for offset in found[0] if found else []:
        if abs(offset.delay) > max(SHIFTED, 3 * offset.std):
            draft.time.setdefault("shift", {})[offset.clock] = round(-offset.delay, 6)
            late = "late" if offset.delay > 0 else "early"
            size = f"{1e3 * abs(offset.delay):.4g} ± {1.96e3 * offset.std:.2g} ms"
            draft.time_comment = f"[s]; {offset.clock} is {size} {late} against θ"
    return tuple(offset for group in found for offset in group)
