"""Simulated sets of the planar arm with as many of its groups as a test needs; one of 6 s takes a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.simulation import Plan, make_plan, simulate_plan, write_plan

TWO = ("t1p1", "t2p2")  # other motions and payloads
HELD_OUT = (*TWO, "t4p2")  # and one for validation


def of_groups(plan: Plan, names: Sequence[str] = TWO, duration: float = 6.0) -> Plan:
    """The plan with these groups only, of `duration` [s] each."""
    groups = tuple(replace(group, duration=duration) for group in plan.groups if group.name in names)
    return replace(plan, groups=groups)


def shorten_presets(
    monkeypatch: pytest.MonkeyPatch, groups: Sequence[str] = HELD_OUT, duration: float = 8.0
) -> None:
    """Let commands simulate a preset with these groups only, of `duration` [s] each."""

    def short(*given: Any, **named: Any) -> Plan:
        return of_groups(make_plan(*given, **named), groups, duration)

    monkeypatch.setattr("flexviz.model.simulation.sets.make_plan", short)


def planar_set(
    folder: Path,
    effects: Sequence[str],
    seed: int,
    start: str = "rest",
    groups: Sequence[str] = TWO,
    duration: float = 6.0,
) -> MeasurementSet:
    """Some groups of the arm with these effects, written to `folder` and read."""
    plan = of_groups(make_plan("planar-2r", effects, start), groups, duration)
    return read_set(write_plan(plan, simulate_plan(plan, seed), folder, seed))
