"""Where a law of no library acts: fits beside a torque of unknown course."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest

from flexviz.diagnosis import diagnose
from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.residuals import SlowResidual
from flexviz.diagnosis.unknown_place import BesideUnknown, unknown_place
from flexviz.diagnosis.vibration import vibration
from flexviz.effects import ChosenEffect, JointState
from flexviz.equation import Equation, Layout, build_signals
from flexviz.estimation import SIDES, UnknownInput
from flexviz.measurements import MeasurementSet, read_set
from flexviz.observers import FlatZeroPhase
from flexviz.recording.texts import diagnosis_text
from flexviz.robot import Robot
from flexviz.simulation import ExtraLaw, Pull, make_plan, simulate_plan, write_plan
from flexviz.view import verdict_html
from flexviz.wording import verdict_text
from tests.planar_arm import HELD_OUT, of_groups
from tests.test_equation import made_up_set, point

HERTZ = 2.7


@dataclass(frozen=True)
class Shaken(ExtraLaw):
    """Something beside the robot shakes the link."""

    def pull(self, at: JointState) -> Pull:
        return Pull(link=1.5 * sin(2 * pi * HERTZ * at.time))


@dataclass(frozen=True)
class Uneven(ExtraLaw):
    """A spring that is softer at some angles."""

    stiffness: float

    def pull(self, at: JointState) -> Pull:
        return Pull(joint=0.15 * self.stiffness * cos(5 * at.theta) * (at.theta - at.q))


@dataclass(frozen=True)
class Saturated(ExtraLaw):
    """The motor gives less the more it has to carry."""

    def pull(self, at: JointState) -> Pull:
        return Pull(motor=0.05 * at.load * (at.load / 10.0) ** 2)


def set_with(law: Callable[[float], ExtraLaw], joint: int, folder: Path) -> tuple[MeasurementSet, np.ndarray]:
    """The planar arm with a law on a joint, and the stiffnesses of its joints."""
    plan = of_groups(make_plan("planar-2r"), HELD_OUT)
    stiffness = plan.model.stiffness
    plan = replace(plan, laws=((plan.model.joints[joint], law(float(stiffness[joint]))),))
    write_plan(plan, simulate_plan(plan, 5), folder, 5)
    return read_set(folder), np.array(stiffness)


@pytest.mark.parametrize("side", SIDES)
def test_the_residual_follows_the_path_of_an_unknown_torque(side: str) -> None:
    """The torque itself, put into the equation: into the motor's, the link's, or the angle of the link."""
    robot = Robot.load("robots:planar_2r")
    whole = made_up_set(robot, "link2", seconds=6.0)
    layout = Layout(robot.joints)
    x = point(layout, robot)
    observer = FlatZeroPhase(2 * np.pi * 14)

    def prepared(tau: np.ndarray | float, theta: np.ndarray | float) -> tuple[Equation, np.ndarray]:
        group = whole.groups[0]
        segment = group.segments[0]
        changed = replace(segment, tau=segment.tau + tau, theta=segment.theta + theta)
        one = replace(whole, groups=(replace(group, segments=(changed,)),))
        signals = build_signals(one, one.groups, observer, drop=(0.4, 0.4))
        equation = Equation(robot, signals, layout)
        return equation, equation.at(x).residual(x)

    time = whole.groups[0].segments[0].time
    u = np.zeros((len(time), 2))
    u[:, 0] = 1e-3 * np.sin(2 * np.pi * 1.3 * time)
    equation, before = prepared(0.0, 0.0)
    _, by_motor = prepared(u, 0.0)
    path = UnknownInput(0, side, 1.0).path(layout, x, equation.at(x).link_terms(x))  # type: ignore[arg-type]
    pulse, at = 2 * np.pi * 1.3, equation.signals.time
    derivatives = 1e-3 * np.array(
        [np.sin(pulse * at), pulse * np.cos(pulse * at), -(pulse**2) * np.sin(pulse * at)]
    )
    found = np.einsum("dtim,dt->ti", path.matrices, derivatives)
    expected = by_motor - before
    on_link = np.zeros_like(expected)
    on_link[:, 0] = derivatives[0]
    if side == "link":
        expected = on_link
    elif side == "transmission":  # the motor torque, less what reaches the link directly
        expected = expected - on_link
    np.testing.assert_allclose(found, expected, atol=4e-3 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("law", "side", "joint"),
    [(Uneven, "transmission", 0), (lambda _: Saturated(), "motor", 0)],
)
def test_the_place_and_the_parameters_beside_it(
    law: Callable[[float], ExtraLaw], side: str, joint: int, tmp_path: Path
) -> None:
    measurements, stiffness = set_with(law, joint, tmp_path / "set")
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=8)
    place = unknown_place(context, fit, lambda: None)
    assert place is not None and (place.unknown.joint, place.unknown.side) == (joint, side)
    beside = BesideUnknown.of(context, fit, place)
    assert beside is not None
    # the law biases the other joint, too; beside an input it cannot
    other = 1 - joint
    k = layout.compliance.start + other
    error, without = (x[k] * stiffness[other] - 1 for x in (beside.fit.x, fit.x))
    if side == "transmission":  # the motor's torque is all that could show the other's stiffness
        assert abs(error) < 4 * beside.covariance.standard_errors[k] / beside.fit.x[k] < 0.02
        assert abs(error) < 0.1 * abs(without)


def test_an_effect_of_the_library_has_a_place_too_but_a_complete_model_none(tmp_path: Path) -> None:
    """The place is that of whatever is missing; beside the right effect no input is needed."""
    plan = of_groups(make_plan("planar-2r", ["coulomb_friction:joint2:coulomb=2"]))
    measurements = read_set(write_plan(plan, simulate_plan(plan, 6), tmp_path / "set", 6))
    joints = measurements.joints
    for effects, found in (((), True), ((ChosenEffect("coulomb_friction", 1),), False)):
        layout = Layout(joints, effects)
        context = FitContext(measurements, layout)
        place = unknown_place(context, context.fit(layout, context.start(layout).x), lambda: None)
        assert (place is not None) == found
        assert place is None or (place.joint, place.unknown.side) == ("joint2", "motor")


def test_a_shaken_link_is_said_to_be_shaken(tmp_path: Path) -> None:
    measurements, stiffness = set_with(lambda _: Shaken(), 1, tmp_path / "set")
    found = diagnose(measurements, apply=True)
    assert found.verdict == found.steps[-1].verdict == "unknown" and len(found.steps) == 1
    assert found.where[0].joint == "joint2" and found.guard is None
    (place,) = [n.text for n in found.notes if n.kind == "place"]
    assert place.startswith(
        "what is missing acts on the link side of joint2: beside a torque of unknown course"
    )
    assert place.endswith(f"; it is a vibration of {HERTZ:.3g} Hz, whatever the robot does")
    (unbiased,) = [n.text for n in found.notes if n.kind == "unbiased"]
    said = unbiased.split("stiffness of joint1 ")[1].split(" Nm/rad")[0]
    value, half = (float(number) for number in said.split(" ± "))
    assert value == pytest.approx(stiffness[0], abs=2 * half) and half < 0.02 * value
    assert (
        found.model is not None and abs(found.model.stiffness[0] - value) > 4 * half
    )  # of the fit without it
    for text in (verdict_text(found), found.summary(), verdict_html(found), diagnosis_text(found)):
        assert text.count(place) == 1


def slow(residual: np.ndarray, velocity: np.ndarray, step: float) -> SlowResidual:
    count = len(residual)
    theta = np.zeros((3, count, 1))
    theta[1, :, 0] = velocity
    stretches = (slice(0, count // 2), slice(count // 2, count))
    return SlowResidual(
        ("joint1",), ("a", "b"), np.repeat([0, 1], count // 2), stretches, np.ones(count, bool),
        step * np.tile(np.arange(count // 2), 2), np.full(count, step), residual[:, None], theta,
        np.zeros((count, 1)),
    )  # fmt: skip


def test_a_vibration_is_found_unless_the_motion_explains_it() -> None:
    step, count = 0.02, 1000
    time = step * np.tile(np.arange(count // 2), 2)
    phase = np.repeat([0.3, 2.1], count // 2)
    rng = np.random.default_rng(1)
    sine = np.sin(2 * np.pi * 3.21 * time + phase)
    noise = 0.3 * rng.standard_normal(count)
    slow_motion = np.sin(2 * np.pi * 0.4 * time)
    found = vibration(slow(sine + noise, slow_motion, step), 0)
    assert found is not None and found.hertz == pytest.approx(3.21, abs=0.005)
    assert found.share == pytest.approx(0.5 / (0.5 + 0.09), abs=0.03)
    assert vibration(slow(3 * noise, slow_motion, step), 0) is None
    assert vibration(slow(sine, np.sin(2 * np.pi * 3.21 * time), step), 0) is None  # the motion itself
    assert vibration(slow(sine, np.sin(2 * np.pi * 1.07 * time), step), 0) is None  # its third harmonic
