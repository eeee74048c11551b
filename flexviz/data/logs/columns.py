"""Recognise columns: families with the same signal of every joint, and which family is θ, τ, q …"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os.path import commonprefix
from typing import Literal

import numpy as np

from flexviz.data.logs.clocks import likely_clocks
from flexviz.data.logs.column_names import TIME, Meaning, meaning, unit_in, without_unit, words
from flexviz.data.logs.formats.base import Log

JOINT = "#"  # stands for the joint in a family's name
FoundBy = Literal["name", "number", "order", "controller"]
# topics that repeat what a JointState has, where there is one
COPIES = re.compile(r"dynamic_joint_states|/(actual|feedback|output)/")
_COMMON = frozenset(("joint", "joints", "link", "axis", "motor", "arm", "left", "right"))


@dataclass(frozen=True)
class ColumnFamily:
    """The same signal of several joints."""

    name: str  # the columns' common name, with # for the joint
    columns: Mapping[str, str]  # joint -> column
    meaning: Meaning  # of the name
    # joints were matched by "name", by "number", or by the "order" in which as many unknown names as the
    # robot has joints appear in the log, or by a "controller"'s ready mapping
    found_by: FoundBy
    stated: Mapping[str, object] = field(default_factory=dict)  # keys of its table in a mapping


def find_families(
    columns: Sequence[str], joints: Sequence[str], units: Mapping[str, str]
) -> list[ColumnFamily]:
    """All families, those with most joints first; `units` are those that the file states with the names."""
    said = {column: words(without_unit(column)) for column in columns}
    named: dict[tuple[str, ...], dict[str, str]] = {}
    numbered: dict[tuple[str, ...], dict[int, str]] = {}
    for column, spoken in said.items():
        if found := joint_in(spoken, joints):
            joint, stem = found
            named.setdefault(stem, {}).setdefault(joint, column)
            continue
        for position, word in enumerate(spoken):
            if word.isdigit():
                stem = (*spoken[:position], JOINT, *spoken[position + 1 :])
                numbered.setdefault(stem, {}).setdefault(int(word), column)
    families = [family(stem, by_joint, units, "name") for stem, by_joint in named.items()]
    # a name with two numbers belongs to the larger family: motor 1 of "can0_motor1", not of can 0
    taken: set[str] = set()
    for stem, by_number in sorted(numbered.items(), key=lambda item: -len(item[1])):
        free = {number: column for number, column in by_number.items() if column not in taken}
        order = numbers_to_joints(sorted(free), joints)
        if order:
            by_joint = {joint: free[number] for joint, number in order.items()}
            families.append(family(stem, by_joint, units, "number"))
            taken |= set(free.values())
    used = {column for known in families for column in known.columns.values()}
    left = [column for column in columns if column not in used]
    ordered = in_order(left, joints, units)
    if len(joints) == 1:
        used = {column for known in ordered for column in known.columns.values()}
        alone = (column for column in left if column not in used)
        ordered += [family(tuple(said[c]), {joints[0]: c}, units, "order") for c in alone]
    return sorted([*families, *ordered], key=lambda f: (-len(f.columns), f.found_by != "name"))


def family(
    stem: tuple[str, ...], columns: dict[str, str], units: Mapping[str, str], found_by: FoundBy
) -> ColumnFamily:
    """A family with what its stem and its first column's unit say."""
    first = next(iter(columns.values()))
    said = [word for word in stem if word != JOINT and not word.isdigit()]
    unit = units.get(first) or unit_in(first)
    return ColumnFamily(pattern(list(columns.values())), columns, meaning(said, unit), found_by)


def in_order(columns: Sequence[str], joints: Sequence[str], units: Mapping[str, str]) -> list[ColumnFamily]:
    """Families of columns `prefix/unknown/suffix` with as many unknown names as there are joints."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for column in columns:
        match = re.fullmatch(r"(.*/)([^/.]+)([/.][^/]*)", column)
        if match:
            found.setdefault((match[1], match[3]), {})[match[2]] = column
    families = []
    for (prefix, suffix), members in found.items():
        if len(members) == len(joints):
            by_joint = dict(zip(joints, members.values(), strict=True))
            families.append(family((*words(prefix), JOINT, *words(suffix)), by_joint, units, "order"))
    return families


def joint_in(spoken: Sequence[str], joints: Sequence[str]) -> tuple[str, tuple[str, ...]] | None:
    """The joint named by a column's words, and the words with # in its place; None where it is not unique."""
    matches: list[tuple[int, str, tuple[str, ...]]] = []
    every = [set(words(joint)) for joint in joints]
    shared = set.intersection(*every) if len(every) > 1 else set()
    for joint in joints:
        whole = words(joint)
        own = [word for word in whole if word not in shared and word not in _COMMON]
        for wanted in (whole, own if any(not word.isdigit() for word in own) else []):
            count = len(wanted)
            starts = range(len(spoken) - count, -1, -1) if wanted else ()  # where they stand last counts
            at = next((i for i in starts if list(spoken[i : i + count]) == wanted), None)
            if at is not None:
                stem = (*spoken[:at], JOINT, *spoken[at + len(wanted) :])
                matches.append((len(wanted), joint, stem))
                break
    longest = max((length for length, _, _ in matches), default=0)
    best = [(joint, stem) for length, joint, stem in matches if length == longest]
    return best[0] if len(best) == 1 else None


def numbers_to_joints(numbers: Sequence[int], joints: Sequence[str]) -> dict[str, int]:
    """Joint -> number; {} where numbers tell nothing.

    Where every joint's name has a number of its own and the columns use these, they are meant; else numbers
    that count up by one are the robot's joints in order.
    """
    own = {joint: [int(word) for word in words(joint) if word.isdigit()][-1:] for joint in joints}
    by_number = {number[0]: joint for joint, number in own.items() if number}
    if len(by_number) == len(joints) and set(numbers) <= set(by_number):
        return {by_number[number]: number for number in numbers}
    if len(numbers) < 2 or list(numbers) != list(range(numbers[0], numbers[0] + len(numbers))):
        return {}
    return dict(zip(joints, numbers, strict=False))


def pattern(columns: Sequence[str]) -> str:
    """The columns' names with # where they differ."""
    if len(columns) < 2:
        return columns[0]
    start = commonprefix(columns)  # noqa: RUF071 - characters are meant
    end = commonprefix([column[len(start) :][::-1] for column in columns])[::-1]  # noqa: RUF071
    return start + JOINT + end


@dataclass(frozen=True)
class Candidates:
    """Families that can be a signal, the likeliest first; `clear` when names alone decide for the first."""

    families: tuple[ColumnFamily, ...]
    clear: bool


def families_of(log: Log, joints: Sequence[str]) -> list[ColumnFamily]:
    """All families of columns that can be signals: not times, and not constant on every joint."""
    columns: list[str] = []
    units: dict[str, str] = {}
    for table in log.tables:
        times = {table.clock, *(name for name, unit in table.units.items() if unit in TIME)}
        times |= set(likely_clocks(table))
        columns += [name for name in table.columns if name not in times]
        units |= table.units
    every = log.columns

    def moves(column: str) -> bool:
        values = every[column].columns[column]
        return bool(np.nanmax(values) > np.nanmin(values))

    families = find_families(columns, joints, units)
    return [family for family in families if any(map(moves, family.columns.values()))]


def candidates(families: Sequence[ColumnFamily], name: str, taken: Sequence[ColumnFamily] = ()) -> Candidates:
    """Families that can be the signal called `name` ("theta", "tau", "q", "tau_joint", "theta_ref").

    `taken` are those that were chosen for signals before.
    """
    ranked = [(rank(family, name, taken), family) for family in families if family not in taken]
    fitting = sorted((item for item in ranked if item[0] > 0), key=lambda item: -item[0])
    clear = bool(fitting) and (len(fitting) == 1 or fitting[0][0] > fitting[1][0])
    return Candidates(tuple(family for _, family in fitting), clear)


def rank(family: ColumnFamily, name: str, taken: Sequence[ColumnFamily]) -> float:
    """How likely a family is the signal; 0: impossible. More joints count most, then the name."""
    said = family.meaning
    likely = 0.0
    if said.computed:
        return 0.0
    if name == "theta" and said.quantity == "position" and not said.reference:
        likely = {"motor": 3.0, None: 2.0, "link": 1.0}[said.side]
    elif name == "q" and said.quantity == "position" and not said.reference:
        theta = next((f.meaning.side for f in taken if f.meaning.quantity == "position"), None)
        likely = {"link": 3.0, None: 2.0, "motor": 0.0}[said.side]
        likely = 0.0 if said.side is None and theta is None else likely  # neither name tells its side
    elif name == "theta_ref" and said.quantity == "position" and said.reference:
        likely = {"motor": 2.0, None: 2.0, "link": 1.0}[said.side]
    elif name == "tau" and said.quantity in ("torque", "current"):
        likely = {"motor": 6.0, None: 5.0, "link": 3.0}[said.side]
        likely = 1.0 if said.sensor else likely - (2.5 if said.reference else 0.0)
        likely -= 1.5 if said.quantity == "current" else 0.0
    elif name == "tau_joint" and said.quantity == "torque" and not said.reference:
        likely = 2.0 if said.sensor else 1.0 if said.side == "link" else 0.0
    copied = 0.5 * bool(COPIES.search(family.name))
    return likely - copied + 0.25 * said.measured + len(family.columns) if likely > 0 else 0.0


def reason(family: ColumnFamily) -> str:
    """Why a family was chosen, for a comment."""
    said = family.meaning
    found_by = {
        "name": "joints by name",
        "number": "joints by number",
        "controller": "joints in the controller's order",
        "order": "joints by the ORDER of unknown names in the log: check it",
    }[family.found_by]
    side = f"{said.side} side" if said.side else ""
    return ", ".join(filter(None, (said.quantity, side, "commanded" if said.reference else "", found_by)))
