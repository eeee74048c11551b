"""Which columns belong together: the same signal of every joint, found by the joints' names or by numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from flexviz.importing.names import Meaning, meaning, stated_unit, without_unit, words

JOINT = "#"  # stands for the joint in a family's name
Told = Literal["name", "number", "order"]
_COMMON = frozenset(("joint", "joints", "link", "axis", "motor", "arm", "left", "right"))


@dataclass(frozen=True)
class Family:
    """The same signal of several joints.

    Attributes:
        name: the columns' common name, with # for the joint.
        columns: joint -> column.
        meaning: what the name says.
        told: the joints were told by their "name", by "number", or by the "order" in which
            as many unknown names as the robot has joints stand in the log.
    """

    name: str
    columns: Mapping[str, str]
    meaning: Meaning
    told: Told


def find_families(columns: Sequence[str], joints: Sequence[str], units: Mapping[str, str]) -> list[Family]:
    """All families, those with most joints first; `units` are those that the file states beside the names."""
    said = {column: words(without_unit(column)) for column in columns}
    named: dict[tuple[str, ...], dict[str, str]] = {}
    numbered: dict[tuple[str, ...], dict[int, str]] = {}
    for column, spoken in said.items():
        found = joint_in(spoken, joints)
        if found is not None:
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
            families.append(
                family(stem, {joint: free[number] for joint, number in order.items()}, units, "number")
            )
            taken |= set(free.values())
    families += in_order(
        [c for c in columns if not any(c in f.columns.values() for f in families)], joints, units
    )
    if len(joints) == 1:
        families += [
            family(tuple(spoken), {joints[0]: column}, units, "order")
            for column, spoken in said.items()
            if not any(column in f.columns.values() for f in families)
        ]
    return sorted(families, key=lambda f: (-len(f.columns), f.told != "name"))


def family(stem: tuple[str, ...], columns: dict[str, str], units: Mapping[str, str], told: Told) -> Family:
    """A family with what its stem and its first column's unit say."""
    first = next(iter(columns.values()))
    said = [word for word in stem if word != JOINT and not word.isdigit()]
    return Family(
        pattern(list(columns.values())), columns, meaning(said, stated_unit(first, units.get(first))), told
    )


def in_order(columns: Sequence[str], joints: Sequence[str], units: Mapping[str, str]) -> list[Family]:
    """Families of columns `prefix/unknown/suffix` with as many unknown names as there are joints."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for column in columns:
        match = re.fullmatch(r"(.*/)([^/.]+)([/.][^/]*)", column)
        if match:
            found.setdefault((match[1], match[3]), {})[match[2]] = column
    return [
        family(
            (*words(prefix), JOINT, *words(suffix)),
            dict(zip(joints, members.values(), strict=True)),
            units,
            "order",
        )
        for (prefix, suffix), members in found.items()
        if len(members) == len(joints)
    ]


def joint_in(spoken: Sequence[str], joints: Sequence[str]) -> tuple[str, tuple[str, ...]] | None:
    """The joint that a name's words name, and the words with # in its place; None when none or several do."""
    best: tuple[int, str, tuple[str, ...]] | None = None
    tied = False
    every = [set(words(joint)) for joint in joints]
    shared = set.intersection(*every) if len(every) > 1 else set()
    for joint in joints:
        whole = words(joint)
        own = [word for word in whole if word not in shared and word not in _COMMON]
        for wanted in (whole, own if any(not word.isdigit() for word in own) else []):
            at = position_of(wanted, spoken)
            if at is None:
                continue
            stem = (*spoken[:at], JOINT, *spoken[at + len(wanted) :])
            if best is None or len(wanted) > best[0]:
                best, tied = (len(wanted), joint, stem), False
            elif len(wanted) == best[0] and joint != best[1]:
                tied = True
            break
    return None if best is None or tied else (best[1], best[2])


def position_of(wanted: Sequence[str], spoken: Sequence[str]) -> int | None:
    """Where the words `wanted` last stand, one after the other, in `spoken`."""
    places = [
        i for i in range(len(spoken) - len(wanted) + 1) if list(spoken[i : i + len(wanted)]) == list(wanted)
    ]
    return places[-1] if wanted and places else None


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
    shortest = min(map(len, columns))
    start = next((i for i in range(shortest) if len({c[i] for c in columns}) > 1), shortest)
    end = next(
        (i for i in range(shortest - start) if len({c[-1 - i] for c in columns}) > 1), shortest - start
    )
    return columns[0][:start] + JOINT + (columns[0][len(columns[0]) - end :] if end else "")
