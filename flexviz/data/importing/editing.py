"""Edit a draft as a form does: a column, its conversion, gears and torque constants, payloads."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

from flexviz.base.errors import InputError
from flexviz.data.importing.draft import DEFAULTS, Draft, DraftJoint
from flexviz.data.importing.previewing import LogPreview
from flexviz.data.logs import CURRENT

Constant = Literal["gear", "torque_constant"]
LARGEST = 1e9  # of a typed number
POINT = [0.0] * 6  # [kg m²] inertia of a body whose size is not stated


def typed_numbers(text: str, count: int, *, signed: bool = False) -> list[float] | None:
    """`count` numbers of a text, one of which stands for all; None for an empty text.

    Positive, or other than zero if `signed`; InputError otherwise.
    """
    wanted = "one number" + (f", or {count} with commas" if count > 1 else "")
    problem = InputError(f"found {text[:40]!r}, expected {wanted}, {'not 0' if signed else 'above 0'}")
    try:
        values = [float(word) for word in re.findall(r"[^,;\s]+", text)]
    except ValueError:
        raise problem from None
    if not values:
        return None
    right = all(0.0 < (abs(value) if signed else value) < LARGEST for value in values)
    if not right or len(values) not in (1, count):
        raise problem
    return values * count if len(values) == 1 else values


def currents(draft: Draft) -> list[str]:
    """The joints whose τ is a current."""
    return [
        name for name, joint in draft.joints.items() if joint.signals.get("tau", {}).get("unit") in CURRENT
    ]


def set_constants(draft: Draft, key: Constant, values: Sequence[float]) -> None:
    """Set the gears or torque constants of all joints.

    A current is before the gear, unless its side is stated. Before a gear of 1 is behind it.
    """
    for joint, value in zip(draft.joints.values(), values, strict=True):
        setattr(joint, key, value)
        for signal in joint.signals.values() if key == "gear" else ():
            if value == 1.0:
                signal.pop("side", None)
            elif signal.get("unit") in CURRENT:
                signal.setdefault("side", "motor")


def set_key(joint: DraftJoint, name: str, key: str, value: Any) -> None:
    """Set a key of a signal that has a column; default values are left out."""
    signal = joint.signals.get(name)
    if signal is None:
        return
    signal[key] = value
    current = signal.get("unit") in CURRENT
    if key == "unit" and current and joint.gear != 1.0:
        signal.setdefault("side", "motor")
    if DEFAULTS.get(key) == value and not (key == "side" and current):  # a current's side stays stated
        del signal[key]


def set_column(draft: Draft, joint: str, name: str, column: str, known: Sequence[str]) -> None:
    """Choose a signal's column ("" for none) among the `known` ones.

    The following columns go to the following joints that have none yet.
    """
    names = list(draft.joints)
    if not column:
        draft.joints[joint].signals.pop(name, None)
        return
    draft.joints[joint].signals[name] = draft.joints[joint].signals.get(name, {}) | {"from": column}
    used = {s["from"] for j in draft.joints.values() for s in j.signals.values()}
    following = known[known.index(column) + 1 :]
    for other, next_column in zip(names[names.index(joint) + 1 :], following, strict=False):
        signals = draft.joints[other].signals
        if name in signals or next_column in used:
            break
        signals[name] = draft.joints[joint].signals[name] | {"from": next_column}


def add_payload(draft: Draft, link: str, mass: float, com: Sequence[float], inertia: Sequence[float]) -> str:
    """Add a payload of one body and return its name: "2 kg", then "2 kg b"."""
    body = {"link": link, "mass": mass, "com": list(com), "inertia": list(inertia) or POINT}
    names = (
        f"{mass:g} kg{suffix}" for suffix in ("", *(f" {letter}" for letter in "bcdefghijklmnopqrstuvwxyz"))
    )
    name = next((name for name in names if name not in draft.payloads), None)
    if name is None:
        raise InputError(f"there are {len(draft.payloads)} payloads already")
    draft.payloads[name] = [body]
    return name


def gaps(draft: Draft) -> list[str]:
    """What must still be stated, one sentence each."""
    joints = used(draft).joints
    found = []
    driving = "the goal of θ" if draft.drive else "τ (torque or current)"
    for name, title in zip(draft.needed, ("θ (motor angle)", driving), strict=True):
        lacking = [joint for joint, entry in joints.items() if name not in entry.signals]
        if lacking or not joints:
            found.append(f"the column of {title}" + (f" of {', '.join(lacking)}" if joints else ""))
    if lacking := [joint for joint in currents(draft) if draft.joints[joint].torque_constant is None]:
        found.append(f"torque constants in Nm/A: τ of {', '.join(lacking)} is a current")
    before = [j for j, e in joints.items() if any(s.get("side") == "motor" for s in e.signals.values())]
    if lacking := [joint for joint in before if draft.joints[joint].gear == 1.0]:
        found.append(f"gear ratios: a signal of {', '.join(lacking)} is before the gear")
    if not draft.time and any(line.startswith("[time]") for line in draft.missing):
        found.append("the time column, or the sampling step")
    return found


def used(draft: Draft) -> Draft:
    """The draft without the joints that have no column."""
    joints = {
        name: joint for name, joint in draft.joints.items() if any(s in joint.signals for s in draft.needed)
    }
    return replace(draft, joints=joints)


def edited(draft: Draft) -> Draft:
    """The draft as it is to be written: only joints with columns, and what is still missing now."""
    return replace(used(draft), missing=gaps(draft))


def carry(old: Draft, new: Draft, log: LogPreview) -> bool:
    """Take over the entries of an earlier draft, if the new logs have its columns."""
    columns = {signal["from"] for joint in old.joints.values() for signal in joint.signals.values()}
    if not columns <= set(log.columns) or set(old.joints) != set(new.joints):
        return False
    new.joints, new.time, new.payloads, new.loads = old.joints, old.time, old.payloads, old.loads
    new.gravity = old.gravity
    kept = {group for group in old.validation if group in new.groups}
    new.validation = kept or new.validation
    return True
