"""Where a law of no library acts: fits beside an arbitrary torque."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.diagnosis.course import Interrupted
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.diagnosis.residual_location import joint_maps
from flexviz.analysis.diagnosis.residuals import SlowResidual
from flexviz.analysis.diagnosis.unknown_input import UnknownInputFit, unknown_place
from flexviz.analysis.diagnosis.vibration import vibration
from flexviz.analysis.estimation import SIDES, Side, UnknownInput
from flexviz.base.statistics import NORMAL_95
from flexviz.content.rendering import panel
from flexviz.content.topics import verdict_panel
from flexviz.content.wording import verdict_text
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import ChosenEffect, JointState
from flexviz.model.equation import Equation, Layout, build_signals
from flexviz.model.observers import FlatZeroPhase
from flexviz.model.simulation import ExtraLaw, Pull, make_plan, simulate_plan, write_plan
from flexviz.outlets.recording.texts import diagnosis_text
from flexviz.robot.robot import Robot
from tests.cases import slow
from tests.model.test_equation import made_up_set, point
from tests.planar_arm import of_groups
from tests.unknown_laws import Uneven, place_at, set_with

HERTZ = 2.7


@dataclass(frozen=True)
class Shaken(ExtraLaw):
    """Something beside the robot shakes the link."""

    def pull(self, at: JointState) -> Pull:
        return Pull(link=1.5 * sin(2 * pi * HERTZ * at.time))


@dataclass(frozen=True)
class Saturated(ExtraLaw):
    """The motor gives less the more it has to carry."""

    def pull(self, at: JointState) -> Pull:
        return Pull(motor=0.05 * at.load * (at.load / 10.0) ** 2)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("side", SIDES)
def test_the_residual_follows_the_path_of_an_unknown_torque(side: Side, damped: bool) -> None:
    """The torque itself, put into the equation: into the motor's, and less what reaches the link directly."""
    robot = Robot.load("robots:planar_2r")
    whole = made_up_set(robot, "link2", seconds=6.0)
    layout = Layout(robot.joints, (ChosenEffect("joint_damping", 0),) if damped else ())
    x = point(layout, robot)
    x[layout.effect_start :] = 0.012 / x[layout.compliance][0]  # a time constant of 12 ms
    observer = FlatZeroPhase(2 * np.pi * 14)

    def prepared(added: np.ndarray | float) -> tuple[Equation, np.ndarray]:
        group = whole.groups[0]
        segment = group.segments[0]
        changed = replace(segment, tau=segment.tau + added)
        one = replace(whole, groups=(replace(group, segments=(changed,)),))
        equation = Equation(robot, build_signals(one, one.groups, observer, drop=(0.4, 0.4)), layout)
        return equation, equation.at(x).residual(x)

    pulse = 2 * np.pi * 1.3
    time = whole.groups[0].segments[0].time
    u = np.zeros((len(time), 2))
    u[:, 0] = 1e-3 * np.sin(pulse * time)
    equation, before = prepared(0.0)
    by_motor = prepared(u)[1] - before
    path = UnknownInput(0, side, 1.0).path(layout, x, equation.at(x).link_terms(x))
    wave = 1e-3 * np.exp(1j * pulse * equation.signals.time)
    passed = np.array(path.derivatives.gains(observer.transfer, np.array([pulse])))[:, 0, None] * wave
    found = np.einsum("dtim,dt->ti", path.matrices, passed.imag)
    on_link = np.zeros_like(by_motor)
    on_link[:, 0] = wave.imag
    expected = {"motor": by_motor, "transmission": by_motor - on_link, "link": on_link}[side]
    np.testing.assert_allclose(found, expected, atol=(0.02 if damped else 4e-3) * np.abs(expected).max())


@pytest.mark.parametrize(
    ("law", "side", "joint"),
    [(Uneven, "transmission", 0), slow(lambda _: Saturated(), "motor", 0)],
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
    beside = UnknownInputFit.of(context, fit, place)
    assert beside is not None
    # the law biases the other joint, too; beside an input it cannot
    other = 1 - joint
    k = layout.compliance.start + other
    error, without = (x[k] * stiffness[other] - 1 for x in (beside.fit.x, fit.x))
    if side == "transmission":  # the motor's torque is all that could show the other's stiffness
        assert abs(error) < 4 * beside.covariance.standard_errors[k] / beside.fit.x[k] < 0.02
        assert abs(error) < 0.1 * abs(without)


@pytest.mark.slow
def test_an_effect_of_the_library_has_a_place_too_but_a_complete_model_none(tmp_path: Path) -> None:
    """The place is that of whatever is missing; beside the right effect no input is needed."""
    plan = of_groups(make_plan("planar-2r", ["coulomb_friction:joint2:coulomb=2"]))
    measurements = read_set(write_plan(plan, simulate_plan(plan, 6), tmp_path / "set", 6))
    joints = measurements.joints
    for effects, found in (((), True), ((ChosenEffect("coulomb_friction", 1),), False)):
        layout = Layout(joints, effects)
        context = FitContext(measurements, layout)
        place = unknown_place(
            context, context.fit(layout, context.start(layout).x, iterations=10), lambda: None
        )
        assert (place is not None) == found
        assert place is None or (place.joint, place.unknown.side) == ("joint2", "motor")


@pytest.mark.slow
def test_a_shaken_link_is_said_to_be_shaken(tmp_path: Path) -> None:
    measurements, stiffness = set_with(lambda _: Shaken(), 1, tmp_path / "set", duration=12.0)
    found = diagnose(measurements, apply=True)
    assert found.verdict == found.steps[-1].verdict == "unknown" and len(found.steps) == 1
    assert found.where[0].joint == "joint2" and found.guard is None
    (place,) = [n for n in found.notes if n.kind == "place"]
    assert place.joints == ("joint2",) and place.values["complete"] and place.values["side"] == "link"
    assert f"{place.values['hertz']:.3g}" == f"{HERTZ:.3g}"
    (unbiased,) = [n for n in found.notes if n.kind == "unbiased"]
    own = [p for p in unbiased.values["parameters"] if p[:2] == ("stiffness", "joint1")]
    value, half = own[0][2], NORMAL_95 * own[0][3]
    assert value == pytest.approx(stiffness[0], abs=2 * half) and half < 0.02 * value
    assert (
        found.model is not None and abs(found.model.stiffness[0] - value) > 4 * half
    )  # of the fit without it
    for text in (
        verdict_text(found),
        found.summary(),
        panel(verdict_panel(found, True)),
        diagnosis_text(found),
    ):
        assert text.count(place.text) == 1


def joint_with(residual: np.ndarray, velocity: np.ndarray, step: float) -> SlowResidual:
    """A joint with this residual; the other one moves."""
    count = len(residual)
    theta = np.zeros((3, count, 2))
    theta[1, :, 1] = velocity
    stretches = (slice(0, count // 2), slice(count // 2, count))
    still = np.zeros(count)
    return SlowResidual(
        ("joint1", "joint2"), ("a", "b"), np.repeat([0, 1], count // 2), stretches, np.ones(count, bool),
        np.tile(np.arange(count // 2), 2) * np.float64(step), np.full(count, step),
        np.stack((residual, still), axis=1), theta, np.zeros((count, 2)),
    )  # fmt: skip


def test_a_vibration_is_found_unless_the_motion_explains_it() -> None:
    step, count = 0.02, 1000
    time = step * np.tile(np.arange(count // 2), 2)
    phase = np.repeat([0.3, 2.1], count // 2)
    rng = np.random.default_rng(1)
    sine = np.sin(2 * np.pi * 3.21 * time + phase)
    noise = 0.3 * rng.standard_normal(count)
    slow_motion = np.sin(2 * np.pi * 0.4 * time)
    found = vibration(joint_with(sine + noise, slow_motion, step), 0)
    assert found == pytest.approx(3.21, abs=0.005)
    assert vibration(joint_with(3 * noise, slow_motion, step), 0) is None
    assert vibration(joint_with(sine, np.sin(2 * np.pi * 3.21 * time), step), 0) is None  # the motion itself
    assert vibration(joint_with(sine, np.sin(2 * np.pi * 1.07 * time), step), 0) is None  # its third harmonic


def test_a_robot_with_one_joint_has_no_place_and_words_say_how_much_is_explained(
    demo: MeasurementSet,
) -> None:
    layout = Layout(demo.joints)
    context = FitContext(demo, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=0)
    single = replace(fit, layout=Layout(("joint1",)))
    assert unknown_place(context, single, lambda: None) is None
    assert place_at(1, layout).fact().values["complete"]
    most = replace(place_at(1, layout, complete=False), sure=False)
    assert most.fact().text.startswith("most of what is missing acts at joint2: ")
    assert UnknownInputFit.of(context, replace(fit, layout=Layout(("joint1",))), most) is None


@pytest.mark.slow
def test_data_without_noise_have_a_place_too(tmp_path: Path) -> None:
    """The input is bounded relative to the noise: its variance would swamp the predictor."""
    plan = of_groups(make_plan("planar-2r"))
    plan = replace(
        plan,
        sensors=replace(plan.sensors, theta_noise=0.0, torque_noise=0.0),
        laws=(("joint1", Saturated()),),
    )
    measurements = read_set(write_plan(plan, simulate_plan(plan, 5), tmp_path / "set", 5))
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=3)
    place = unknown_place(context, fit, lambda: None)
    assert place is None or place.joint == "joint1"


def test_the_search_for_a_place_can_be_stopped(demo: MeasurementSet) -> None:
    layout = Layout(demo.joints)
    context = FitContext(demo, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=0)

    def stop() -> None:
        raise Interrupted

    with pytest.raises(Interrupted):
        unknown_place(context, fit, stop)


def test_part_of_a_period_is_no_vibration() -> None:
    """Short stretches with constants beside a long one: a sine slower than they are fits any constant."""
    rng = np.random.default_rng(4)
    step, lengths = 0.02, [3000, *[500] * 5]
    ends = np.cumsum(lengths)
    stretches = tuple(slice(end - n, end) for n, end in zip(lengths, ends, strict=True))
    residual = 0.1 * rng.standard_normal(ends[-1])
    for k, rows in enumerate(stretches[1:]):
        residual[rows] += 1.0 + 0.2 * k
    time = step * np.concatenate([np.arange(n, dtype=float) for n in lengths])
    theta = np.zeros((3, ends[-1], 2))
    theta[1] = np.sin(2 * np.pi * 0.55 * time)[:, None]
    count = int(ends[-1])
    data = SlowResidual(
        ("joint1", "joint2"), ("a",), np.zeros(count, int), stretches, np.ones(count, bool), time,
        np.full(count, step), np.stack((residual, residual), axis=1), theta, np.zeros((count, 2)),
    )  # fmt: skip
    assert vibration(data, 0) is None


@pytest.mark.parametrize(("carried", "says"), [(3.0, True), (0.1, False)])
def test_a_residual_that_is_most_of_the_load_does_not_follow_it(carried: float, says: bool) -> None:
    """A missing torque of the load against the motor contains itself, and little else on a light link."""
    count, step = 2000, 0.02
    time = step * np.tile(np.arange(count // 2), 2)
    own = np.sin(2 * np.pi * 0.31 * time)
    missing = own**3 if says else np.sign(np.sin(2 * np.pi * 0.83 * time))
    data = joint_with(missing, np.cos(2 * np.pi * 0.55 * time), step)
    data.load[:, 0] = carried * own + missing
    (found,) = (m for m in joint_maps(data, 0) if m.variable == "load")
    assert found.explained > 0.9 if says else found.explained == 0.0
