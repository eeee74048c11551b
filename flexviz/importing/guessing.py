"""Which family of columns is θ, τ, q …: by what their names say, in an order of likelihood with reasons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.importing.clocks import likely_clocks
from flexviz.importing.families import Family, find_families
from flexviz.importing.log import Log
from flexviz.importing.units import TIME


@dataclass(frozen=True)
class Candidates:
    """Families that can be a signal, the likeliest first; `clear` when the first is so by its name alone."""

    families: tuple[Family, ...]
    clear: bool


def families_of(log: Log, joints: Sequence[str]) -> list[Family]:
    """All families of columns that can be signals: not times, and not constant on every joint."""
    columns: list[str] = []
    units: dict[str, str] = {}
    for table in log.tables:
        clocks = {
            table.clock,
            *(name for name, unit in table.units.items() if unit in TIME),
            *likely_clocks(table),
        }
        columns += [name for name in table.columns if name not in clocks]
        units |= table.units
    every = log.columns
    return [
        family
        for family in find_families(columns, joints, units)
        if any(np.nanmax(v) > np.nanmin(v) for v in (every[c].columns[c] for c in family.columns.values()))
    ]


def candidates(families: Sequence[Family], name: str, taken: Sequence[Family] = ()) -> Candidates:
    """Families that can be the signal called `name` ("theta", "tau", "q", "tau_joint", "theta_ref").

    `taken` are those that were chosen for signals before.
    """
    ranked = [(rank(family, name, taken), family) for family in families if family not in taken]
    fitting = sorted((item for item in ranked if item[0] > 0), key=lambda item: -item[0])
    clear = bool(fitting) and (len(fitting) == 1 or fitting[0][0] > fitting[1][0])
    return Candidates(tuple(family for _, family in fitting), clear)


def rank(family: Family, name: str, taken: Sequence[Family]) -> float:
    """How likely a family is the signal, 0: not at all. More joints count most, then what the name says."""
    said = family.meaning
    likely = 0.0
    if name == "theta" and said.quantity == "position" and not said.reference:
        likely = {"motor": 3.0, None: 2.0, "link": 1.0}[said.side]
    elif name == "q" and said.quantity == "position" and not said.reference:
        theta = next((f.meaning.side for f in taken if f.meaning.quantity == "position"), None)
        likely = {"link": 3.0, None: 2.0, "motor": 0.0}[said.side]
        likely = 0.0 if said.side is None and theta is None else likely  # nothing tells which side either is
    elif name == "theta_ref" and said.quantity == "position" and said.reference:
        likely = {"motor": 2.0, None: 2.0, "link": 1.0}[said.side]
    elif name == "tau" and said.quantity in ("torque", "current"):
        likely = {"motor": 6.0, None: 5.0, "link": 3.0}[said.side]
        likely = 1.0 if said.sensor else likely - (2.5 if said.reference else 0.0)
        likely -= 1.5 if said.quantity == "current" else 0.0
    elif name == "tau_joint" and said.quantity == "torque" and not said.reference:
        likely = 2.0 if said.sensor else 1.0 if said.side == "link" else 0.0
    return likely + len(family.columns) if likely > 0 else 0.0


def reason(family: Family) -> str:
    """Why a family was taken, for a comment."""
    said = family.meaning
    told = {
        "name": "joints by name",
        "number": "joints by number",
        "order": "joints by the ORDER of unknown names in the log: check it",
    }[family.told]
    parts = [
        said.quantity,
        f"{said.side} side" if said.side else "",
        "asked for" if said.reference else "",
        told,
    ]
    return ", ".join(part for part in parts if part)
