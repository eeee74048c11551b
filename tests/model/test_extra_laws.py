"""Extra laws in the simulator: a law that repeats one of the library's gives the same motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import ClassVar

import numpy as np
import pytest

from flexviz.model.effects import JointState
from flexviz.model.simulation import ExtraLaw, Plan, Pull, Run, make_plan


class Spring(ExtraLaw):
    """A cable spring of 3 Nm/rad at 0.2 rad."""

    def pull(self, at: JointState) -> Pull:
        return Pull(link=3.0 * (at.q - 0.2))


class Drag(ExtraLaw):
    """Quadratic friction of 0.4 Nm s²/rad²."""

    def pull(self, at: JointState) -> Pull:
        return Pull(motor=0.4 * at.theta_velocity * abs(at.theta_velocity))


class Hardening(ExtraLaw):
    """A cubic spring of 1e6 Nm/rad³."""

    def pull(self, at: JointState) -> Pull:
        return Pull(joint=1e6 * (at.theta - at.q) ** 3)


@dataclass(frozen=True)
class Pendulum(ExtraLaw):
    """A mass on a spring, 2 Hz."""

    inertia: float = 0.3  # [kg m²]
    states: ClassVar[int] = 2

    def pull(self, at: JointState) -> Pull:
        acceleration = -((4 * pi) ** 2) * at.z[0]
        return Pull(link=self.inertia * acceleration, rates=(at.z[1] - at.q_velocity, acceleration))


def run(plan: Plan) -> Run:
    return plan.run(replace(plan.groups[0], duration=0.6))


@pytest.mark.parametrize(
    ("law", "text"),
    [
        (Spring(), "cable_spring:joint1:stiffness=3,rest_angle=0.2"),
        (Drag(), "quadratic_friction:joint1:quadratic=0.4"),
        (Hardening(), "stiffness_hardening:joint1:cubic_stiffness=1e6"),
    ],
)
def test_same_law_same_motion(law: ExtraLaw, text: str) -> None:
    own = run(replace(make_plan("planar-2r"), laws=(("joint1", law),)))
    library = run(make_plan("planar-2r", [text]))
    np.testing.assert_allclose(own.theta, library.theta, atol=1e-9)
    np.testing.assert_allclose(own.tau_joint, library.tau_joint, atol=1e-6)


def test_own_states() -> None:
    """The arm with a mass on a spring rings with it, and not without."""
    plan = make_plan("planar-2r")
    with_mass = run(replace(plan, laws=(("joint2", Pendulum()), ("joint1", Spring()))))
    without = run(replace(plan, laws=(("joint2", Pendulum(0.0)), ("joint1", Spring()))))
    assert np.abs(with_mass.tau_joint - without.tau_joint)[:, 1].max() > 0.01
    bare = run(replace(plan, laws=(("joint1", Spring()),)))
    np.testing.assert_allclose(without.theta, bare.theta, atol=1e-12)


def test_at_rest_from_the_start() -> None:
    """The static equilibrium knows of them."""

    class Load(ExtraLaw):
        def pull(self, at: JointState) -> Pull:
            return Pull(motor=2.0, link=3.0, joint=0.5)

    moved = run(replace(make_plan("planar-2r"), laws=(("joint2", Load()),)))
    assert np.abs(moved.q_velocity[:5]).max() < 1e-9
