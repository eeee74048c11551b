"""Motions of the robots, computed once."""

from __future__ import annotations

from typing import Any

from flexviz.app.state import Derived
from flexviz.measurements import Group, MeasurementSet
from flexviz.scene import RobotMotion, measured_motion, with_replay

KEPT = 2  # the shown model, and the one that is compared with it


class Motions:
    """The latest motions."""

    def __init__(self) -> None:
        self._kept: list[tuple[tuple[Any, ...], RobotMotion]] = []

    def of(self, measurements: MeasurementSet, group: Group, derived: Derived) -> RobotMotion:
        """The measured motion of a group and, once it is simulated, that of a model."""
        result, run = derived.result, derived.replays.get(group.name)
        key = (result, group, run)
        for known, motion in self._kept:
            if all(a is b for a, b in zip(known, key, strict=True)):
                return motion
        motion = measured_motion(measurements, group, result)
        motion = motion if run is None else with_replay(motion, run)
        self._kept = [*self._kept[1 - KEPT :], (key, motion)]
        return motion
