"""Ready mappings of controllers' own formats: one file each in `ready/`, recognised by the columns' names.

Names are regular expressions for the end of a column's name; {k} stands for the joint's number (from 0 or 1),
{joint} for its name, {id} for either. Of several entries for a signal the first with columns for the joints
counts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from flexviz.base import toml
from flexviz.base.schemas import Number, StrictTable, Text, validate
from flexviz.checks import may_be_signed, sign_bit
from flexviz.data.logs import (
    CURRENT,
    MAPPING_FORMAT,
    ColumnFamily,
    Log,
    Meaning,
    Quantity,
    TimeColumn,
    pattern,
)

FOLDER = Path(__file__).parent / "ready"
FEW_COUNTS = 10  # that are no motion
JOINT = {"{k}": r"(?P<joint>\d+)", "{joint}": r"(?P<joint>[^/]+)", "{id}": r"(?P<joint>[\w-]+)"}


class SignalColumns(StrictTable):
    """The columns of a signal on all joints."""

    columns: Text
    unit: Text | Number | None = None
    side: Literal["joint", "motor"] = "joint"
    offset: Number = 0.0
    sign_bit: int | None = None  # of a register in sign-magnitude form
    current: bool = False  # counts of a current: `unit` is their size in A
    behind_gear: bool = False  # τ of a joint torque sensor
    means: str = ""  # of τ: what it contains
    needs: str = ""  # a unit that only the log's own header may state

    def find(self, names: Sequence[str], joints: Sequence[str]) -> dict[str, str]:
        """Joint -> column; {} where there are none. Several sets of columns: the first one counts."""
        text = self.columns.replace(r"\[", r"\[(?::,)?")
        for key, form in JOINT.items():
            text = text.replace(key, form)
        form = re.compile(rf"(?P<start>.*[/.])?{text}", re.IGNORECASE)
        found: dict[str, dict[str, str]] = {}
        for name in names:
            if match := form.fullmatch(name):
                found.setdefault(match["start"] or "", {}).setdefault(match["joint"], name)
        columns = next(iter(found.values()), {})
        if named := {joint: columns[joint] for joint in joints if joint in columns}:
            return named
        numbers = sorted(columns, key=lambda x: (not x.isdigit(), int(x) if x.isdigit() else 0))
        return {joint: columns[number] for joint, number in zip(joints, numbers, strict=False)}

    def family(self, name: str, columns: Mapping[str, str], log: Log) -> ColumnFamily:
        """The columns as a family, with what is stated of them; a unit in the log counts more."""
        first = next(iter(columns.values()))
        own = log.columns[first].units.get(first)
        is_current = self.current or (own or self.unit) in CURRENT
        torque: Quantity = "current" if is_current else "torque"
        quantity: Quantity = torque if name in ("tau", "tau_joint") else "position"
        unit = own or (self.unit if isinstance(self.unit, str) else None)
        said = Meaning(quantity, name == "theta_ref", unit=unit, measured=True)
        stated: dict[str, Any] = {"unit": self.unit} if own is None and isinstance(self.unit, float) else {}
        stated |= {"side": "motor"} if self.side == "motor" else {}
        stated |= {"offset": self.offset} if self.offset else {}
        if self.sign_bit is not None and all(
            may_be_signed(np.asarray(log.columns[column].columns[column], dtype=float), self.sign_bit)
            for column in columns.values()
        ):
            stated["sign_bit"] = self.sign_bit
        return ColumnFamily(pattern(list(columns.values())), columns, said, "controller", stated)


Entries = Annotated[list[SignalColumns], Field(min_length=1)]


class ReadyMapping(StrictTable):
    """A controller's own names."""

    title: Text
    marks: list[list[Text]] = Field(
        default_factory=list
    )  # further columns by any set of which it is recognised
    signed: dict[Text, int] = Field(
        default_factory=dict
    )  # further columns by whose sign bit it is recognised
    time: TimeColumn | None = None
    theta: Entries
    tau: Entries
    q: list[SignalColumns] = Field(default_factory=list)
    tau_joint: list[SignalColumns] = Field(default_factory=list)
    theta_ref: list[SignalColumns] = Field(default_factory=list)

    def roles(self, log: Log, joints: Sequence[str]) -> tuple[dict[str, ColumnFamily], SignalColumns | None]:
        """Signal -> its columns, and the entry of τ; {} where the log is not of this kind."""
        names = list(log.columns)
        marked = not self.marks or any(all(_among(names, mark) for mark in marks) for marks in self.marks)
        if not marked and not any(_signed(log, mark, bit) for mark, bit in self.signed.items()):
            return {}, None
        roles: dict[str, ColumnFamily] = {}
        torque: SignalColumns | None = None
        for signal in ("theta", "tau", "q", "tau_joint", "theta_ref"):
            for entry in getattr(self, signal):
                columns = entry.find(names, joints)
                if columns and all(columns != taken.columns for taken in roles.values()):
                    roles[signal] = entry.family(signal, columns, log)
                    torque = entry if signal == "tau" else torque
                    break
            if signal == "theta" and not roles:
                return {}, None
        return roles, torque


def _among(names: Sequence[str], mark: str) -> bool:
    """Whether one of a log's columns has this name, by itself or behind a joint's."""
    return any(_is_called(name, mark) for name in names)


def _is_called(name: str, mark: str) -> bool:
    return bool(re.fullmatch(rf"(.*[^a-z])?{mark}.*", name, re.IGNORECASE))


def _signed(log: Log, mark: str, bit: int) -> bool:
    """Whether a column with this name is a register with this sign bit."""
    tables = {name: table for name, table in log.columns.items() if _is_called(name, mark)}
    columns = (np.asarray(table.columns[name], dtype=float) for name, table in tables.items())
    return any(sign_bit(values[np.isfinite(values)]) == bit for values in columns)


@lru_cache(maxsize=1)
def ready_mappings() -> tuple[ReadyMapping, ...]:
    """All ready mappings."""
    # Feetech before Dynamixel: its mark is the narrower one
    files = sorted(FOLDER.glob("*.toml"), key=lambda file: (file.stem == "dynamixel", file.stem))
    return tuple(validate(ReadyMapping, toml.read(file), file, MAPPING_FORMAT) for file in files)


@dataclass(frozen=True)
class Recognised:
    """A log of a controller that there is a ready mapping for."""

    mapping: ReadyMapping
    roles: Mapping[str, ColumnFamily]  # signal -> its columns
    torque: SignalColumns | None  # the entry of τ; None where the log has none


def counted(family: ColumnFamily, log: Log) -> bool:
    """Whether columns that a mapping takes for a register's counts can be that.

    Fractions within a few counts are angles: a register has whole numbers, and so few are no motion.
    """
    if "unit" not in family.stated:
        return True
    columns = [log.columns[name].columns[name] for name in family.columns.values()]
    known = np.concatenate([column[np.isfinite(column)] for column in columns])
    whole = bool(np.all(known == np.round(known)))
    return whole or max(float(np.ptp(column[np.isfinite(column)])) for column in columns) > FEW_COUNTS


def recognised(log: Log, joints: Sequence[str]) -> Recognised | None:
    """The ready mapping of a log; None where there is none."""
    for mapping in ready_mappings():
        roles, torque = mapping.roles(log, joints)
        if roles and counted(roles["theta"], log):
            return Recognised(mapping, roles, torque)
    return None
