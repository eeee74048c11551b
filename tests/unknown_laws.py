"""Laws of no library on the planar arm, and their places."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, exp, tanh
from pathlib import Path

import numpy as np

from flexviz.analysis.diagnosis.unknown_input import UnknownPlace
from flexviz.analysis.estimation import UnknownInput
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import JointState
from flexviz.model.equation import Layout
from flexviz.model.simulation import ExtraLaw, Pull, make_plan, simulate_plan, write_plan
from tests.planar_arm import HELD_OUT, of_groups


@dataclass(frozen=True)
class Uneven(ExtraLaw):
    """A spring that is softer at some angles."""

    stiffness: float
    share: float = 0.15

    def pull(self, at: JointState) -> Pull:
        return Pull(joint=self.share * self.stiffness * cos(5 * at.theta) * (at.theta - at.q))


@dataclass(frozen=True)
class Rough(ExtraLaw):
    """Friction in a part of the motor's range."""

    peak: float = 3.0
    position: float = 0.1
    width: float = 0.25

    def pull(self, at: JointState) -> Pull:
        size = self.peak * exp(-(((at.theta - self.position) / self.width) ** 2))
        return Pull(motor=size * tanh(at.theta_velocity / 0.005))


def set_with(
    law: Callable[[float], ExtraLaw], joint: int, folder: Path, seed: int = 5, duration: float = 6.0
) -> tuple[MeasurementSet, np.ndarray]:
    """The planar arm with a law on a joint, and the stiffnesses of its joints."""
    plan = of_groups(make_plan("planar-2r"), HELD_OUT, duration)
    stiffness = plan.model.stiffness
    plan = replace(plan, laws=((plan.model.joints[joint], law(float(stiffness[joint]))),))
    write_plan(plan, simulate_plan(plan, seed), folder, seed)
    return read_set(folder), np.array(stiffness)


def place_at(joint: int, layout: Layout, complete: bool = True) -> UnknownPlace:
    """A place on the link side of a joint."""
    left = 0.5 if complete else 5.0
    return UnknownPlace(UnknownInput(joint, "link", 1.0), layout, np.zeros(layout.size), True, left, True)
