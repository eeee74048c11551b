"""The identification equation: every Jacobian against finite differences, and zero at the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.estimation.noise_propagation import signal_sensitivity
from flexviz.analysis.estimation.prior import BASIS, Prior, physically_consistent, pseudo_inertia
from flexviz.base.errors import InputError
from flexviz.data.measurements import Group, MeasurementSet, Segment
from flexviz.model.effects import EFFECTS, ChosenEffect, choose_effects
from flexviz.model.equation import Equation, Layout, build_signals
from flexviz.model.equation.fine_signals import LINK_VELOCITY_NOISE, TORQUE_NOISE, torque_band
from flexviz.model.equation.motions import LEAST_VISCOUS, LEAST_VISCOUS_SHARE, viscous_scale
from flexviz.model.equation.signals import FINE_STEP, equation_stride, fine_samples
from flexviz.model.observers import FlatZeroPhase, make_observer
from flexviz.robot.robot import PayloadBody, Robot


def made_up_set(robot: Robot, link: str, seed: int = 0, seconds: float = 4.0) -> MeasurementSet:
    """Smooth random signals that obey no equation: Jacobians must hold anywhere."""
    rng = np.random.default_rng(seed)
    step, n = 2e-3, robot.n
    time = step * np.arange(int(seconds / step))

    def smooth(size: float) -> np.ndarray:
        omega = rng.uniform(1.0, 12.0, (5, 1, n))
        wave = np.sin(omega * time[:, None] + rng.uniform(0, 6, (5, 1, n))) * rng.uniform(0.3, 1, (5, 1, n))
        return size * wave.sum(axis=0)

    groups = []
    for k, bodies in enumerate(
        ((), (PayloadBody(link, 1.5, [0.1, 0.02, 0.05], [0.01, 0.02, 0.03, 0, 0, 0]),))
    ):
        segment = Segment(time, smooth(0.4), smooth(20.0), step)
        names = f"g{k}", f"t{k}", f"p{k}"
        degrees = np.linspace(15.0, 50.0, n) + 10.0 * k
        groups.append(Group(*names, bodies, False, Path("none"), (segment,), time, temperature=degrees))
    return MeasurementSet(
        path=Path("none"),
        name="made-up",
        robot=robot,
        joints=robot.joints,
        torque_hold=0.0,
        initial_stiffness=None,
        initial_motor_inertia=None,
        kp=None,
        kd=None,
        effects=(),
        payloads={g.payload: g.bodies for g in groups},
        groups=tuple(groups),
        simulated=True,
    )


def point(layout: Layout, robot: Robot, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    x = np.zeros(layout.size)
    x[layout.inertial] = (physically_consistent(robot.cad_parameters) * rng.uniform(0.9, 1.1)).ravel()
    x[layout.compliance] = 1 / rng.uniform(500, 3000, layout.n)
    x[layout.motor_inertia] = rng.uniform(0.3, 2.0, layout.n)
    x[layout.link_viscous] = rng.uniform(0.2, 2.0, layout.n)
    x[layout.motor_viscous] = rng.uniform(0.2, 2.0, layout.n)
    x[layout.effect_start :] = rng.uniform(0.5, 2.0, layout.size - layout.effect_start)
    return x


ROBOTS = {
    "planar": (lambda: Robot.load("robots:planar_2r"), "link2"),
    "panda": (
        lambda: Robot.load("example-robot-data:panda", [f"panda_joint{k}" for k in range(1, 8)]),
        "panda_hand",
    ),
    "ur5, joints in another order": (
        lambda: Robot.load(
            "example-robot-data:ur5",
            [
                "elbow_joint",
                "shoulder_pan_joint",
                "shoulder_lift_joint",
                "wrist_3_joint",
                "wrist_1_joint",
                "wrist_2_joint",
            ],
        ),
        "tool0",
    ),
}


def some_values(effect: str) -> np.ndarray:
    """Parameters at which the effect is clearly there and smooth."""
    values = {
        "stribeck_friction": [1.5, 0.3],
        "friction_drift": [0.8, 2.5],
        "presliding_hysteresis": [40.0, 2.0],
        "startup_friction": [0.9, 0.05],
        "thinning_friction": [0.9, 0.15],
        "torque_ripple": [1.2, 3.3, 0.4],
        "transmission_error": [0.004, 2.2, 0.7],
        "torque_delay": [0.002],
        "torque_gain": [0.1],
        "stiffness_hardening": [2e5],
        "driving_friction": [0.1, 0.15],
        "backlash": [0.002],
        "joint_damping": [12.0],
        "cable_spring": [3.0, 0.2],
        "gravity_compensator": [6.0, -2.5],
        "payload_error": [0.15],
        "base_tilt": [0.05, -0.03],
        "external_contact": [2.0, 1.5107, 2.4713],
        "load_dependent_friction": [0.08],
        "motor_coupling": [0.2],
    }
    return np.array(values.get(effect, np.full(len(EFFECTS[effect].parameters), 0.9)))


def everywhere(robot: Robot) -> tuple[ChosenEffect, ...]:
    """Each effect once, spread over the joints."""
    out = []
    for k, (name, effect) in enumerate(EFFECTS.items()):
        joint = None if effect.scope in ("set", "payload") else k % robot.n
        group = "g1" if effect.scope == "episode" else None
        out.append(ChosenEffect(name, joint, group, "p1" if effect.scope == "payload" else None))
    return tuple(out)


@pytest.mark.parametrize("effects", [False, True], ids=["base", "all effects"])
@pytest.mark.parametrize("name", ROBOTS)
def test_jacobian_against_finite_differences(name, effects):
    make, link = ROBOTS[name]
    robot = make()
    measurements = made_up_set(robot, link, seconds=5.0)
    layout = Layout(robot.joints, everywhere(robot) if effects else ())
    signals = build_signals(measurements, measurements.groups, FlatZeroPhase(2 * np.pi * 5), sample_step=0.2)
    equation = Equation(robot, signals, layout)
    x = point(layout, robot)
    for effect, where in layout.effect_slices():
        x[where] = some_values(effect.effect)
    check_slopes(equation, layout, x)


@pytest.mark.parametrize("joint", [0, 1])
def test_jacobian_where_the_link_has_nearly_all_friction(joint: int):
    """There the drift of friction is scaled by a share of both sides' viscous friction."""
    robot = Robot.load("robots:planar_2r")
    measurements = made_up_set(robot, "link2", seconds=5.0)
    layout = Layout(robot.joints, (ChosenEffect("friction_drift", joint),))
    signals = build_signals(measurements, measurements.groups, FlatZeroPhase(2 * np.pi * 5), sample_step=0.2)
    x = point(layout, robot)
    x[layout.effect_start :] = some_values("friction_drift")
    x[layout.motor_viscous] = 0.05 * x[layout.link_viscous]
    check_slopes(Equation(robot, signals, layout), layout, x)


def check_slopes(equation: Equation, layout: Layout, x: np.ndarray) -> None:
    seen = equation.at(x)
    jacobian = seen.evaluate(x).jacobian
    size = np.abs(jacobian).max(axis=(0, 1))
    inertial = range(0, layout.compliance.start, 7 if layout.effects else 1)  # r is linear in them
    for k in (*inertial, *range(layout.compliance.start, layout.size)):
        h = 1e-5 * max(abs(x[k]), 1e-3 if k < layout.compliance.start else 1e-8)
        up, down = x.copy(), x.copy()
        up[k] += h
        down[k] -= h
        slope = (seen.evaluate(up).residual - seen.evaluate(down).residual) / (up[k] - down[k])
        error = np.abs(slope - jacobian[:, :, k]).max()
        rounding = 1e-13 * np.abs(seen.evaluate(x).residual).max() / h
        assert error <= 1e-6 * max(size[k], 1e-9) + 50 * rounding, layout.names()[k]


def test_sensitivity_to_signals_against_finite_differences():
    robot = Robot.load("robots:planar_2r")
    measurements = made_up_set(robot, "link2")
    layout = Layout(robot.joints)
    signals = build_signals(measurements, measurements.groups, FlatZeroPhase(2 * np.pi * 5), sample_step=0.1)
    x = point(layout, robot)
    equation = Equation(robot, signals, layout)
    parts = signal_sensitivity(layout, x, equation.at(x).link_terms(x), x[layout.compliance])
    theta, tau = (direct + elastic for direct, elastic in zip(*parts, strict=True))
    for matrices, field in ((theta, "theta"), (tau, "tau")):
        for k in range(len(matrices)):
            for j in range(robot.n):
                moved = []
                for sign in (1, -1):
                    values = getattr(signals, field).copy()
                    values[k, :, j] += sign * 1e-5
                    other = Equation(robot, replace(signals, **{field: values}), layout)
                    moved.append(other.evaluate(x).residual)
                slope = (moved[0] - moved[1]) / 2e-5
                np.testing.assert_allclose(matrices[k][:, :, j], slope, rtol=1e-5, atol=1e-6)


def test_order_of_joints_does_not_matter():
    names = ["joint2", "joint1"]
    first = Robot.load("robots:planar_2r")
    second = Robot.load("robots:planar_2r", names)
    measurements = made_up_set(first, "link2")
    turned = replace(
        measurements,
        robot=second,
        joints=second.joints,
        groups=tuple(
            replace(
                g,
                segments=tuple(replace(s, theta=s.theta[:, ::-1], tau=s.tau[:, ::-1]) for s in g.segments),
            )
            for g in measurements.groups
        ),
    )
    results = []
    for m, robot in ((measurements, first), (turned, second)):
        layout = Layout(robot.joints)
        signals = build_signals(m, m.groups, FlatZeroPhase(2 * np.pi * 5))
        x = point(layout, first)
        if robot is second:
            x = np.concatenate([x[:20].reshape(2, 10)[::-1].ravel(), x[20:].reshape(-1, 2)[:, ::-1].ravel()])
        results.append(Equation(robot, signals, layout).evaluate(x).residual)
    np.testing.assert_allclose(results[0], results[1][:, ::-1], rtol=1e-10, atol=1e-9)


def test_choosing_effects():
    joints = ("a", "b")
    chosen = choose_effects(["coulomb_friction", "torque_offset:b", "coulomb_friction:a"], joints)
    assert chosen == (
        ChosenEffect("coulomb_friction", 0),
        ChosenEffect("coulomb_friction", 1),
        ChosenEffect("torque_offset", 1),
    )
    with pytest.raises(InputError, match="did you mean"):
        choose_effects(["coulomb_frictoin"], joints)
    with pytest.raises(InputError, match='joint "c"'):
        choose_effects(["coulomb_friction:c"], joints)


@pytest.mark.parametrize(
    ("text", "effect"),
    [
        ("coulomb_friction:b", ChosenEffect("coulomb_friction", 1)),
        ("base_tilt", ChosenEffect("base_tilt")),
        ("payload_error:p2", ChosenEffect("payload_error", payload="p2")),
        ("external_contact:a@g2", ChosenEffect("external_contact", 0, "g2")),
        ("external_contact:a@b@g@2", ChosenEffect("external_contact", 2, "g@2")),
    ],
)
def test_effects_as_text_and_back(text, effect):
    joints = ("a", "b", "a@b")
    assert choose_effects([text], joints, ["p2", "p3"], ["g1", "g2", "g@2"]) == (effect,)
    assert effect.text(joints) == text
    value = effect.value(joints, {"x": 1.0})
    assert value.text == text and value.parameters == {"x": 1.0}
    assert ChosenEffect.of(value, joints) == effect


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("external_contact", 'name the joint and group, as in "external_contact:a@g1"'),
        ("external_contact:a", 'name the group, as in "external_contact:a@g1"'),
        ("external_contact:c@g1", 'joint "c" is not in the set; valid: a, b'),
        ("external_contact:a@g3", 'group "g3" is not in the set'),
        ("payload_error:p1", 'payload "p1" is not carried'),
        ("base_tilt:a", 'write "base_tilt"'),
    ],
)
def test_effects_that_are_nowhere(text, words):
    with pytest.raises(InputError, match=words):
        choose_effects([text], ("a", "b"), ["p2"], ["g1", "g2"])


def test_prior_derivatives_and_feasibility():
    robot = Robot.load("example-robot-data:panda", [f"panda_joint{k}" for k in range(1, 8)])
    layout = Layout(robot.joints)
    cad = physically_consistent(robot.cad_parameters)
    assert np.all(np.linalg.eigvalsh(pseudo_inertia(cad))[:, 0] > 0)
    x = point(layout, robot)
    prior = Prior(layout, cad, x * 0.8, np.maximum(np.abs(x), 1e-3))
    x[3] += 0.01 * x[0]
    gradient, hessian = prior.gradient_and_hessian(x)
    rng = np.random.default_rng(0)
    direction = rng.standard_normal(layout.size) * np.maximum(np.abs(x), 1e-4) * 1e-6
    slope = prior.value(x + direction) - prior.value(x - direction)
    assert slope / 2 == pytest.approx(gradient @ direction, rel=1e-5)
    change = prior.gradient_and_hessian(x + direction)[0] - prior.gradient_and_hessian(x - direction)[0]
    np.testing.assert_allclose(
        change / 2, hessian @ direction, rtol=1e-4, atol=1e-9 * np.abs(hessian @ direction).max()
    )
    x[0] = -1.0
    assert not prior.feasible(x) and prior.value(x) == np.inf
    assert BASIS.shape == (10, 4, 4)


def test_too_short_a_record_is_named():
    robot = Robot.load("robots:planar_2r")
    measurements = made_up_set(robot, "link2", seconds=0.5)
    with pytest.raises(InputError, match="settle"):
        build_signals(measurements, measurements.groups, FlatZeroPhase(2 * np.pi * 2))


def test_a_vector_is_a_model_and_back():
    layout = Layout(("a", "b"), (ChosenEffect("stribeck_friction", 1), ChosenEffect("torque_delay", None)))
    x = np.arange(1.0, layout.size + 1)
    model = layout.model(x)
    np.testing.assert_allclose(model.stiffness, [1 / 21, 1 / 22])
    np.testing.assert_array_equal(model.inertial.ravel(), x[:20])
    others = model.motor_inertia, model.link_viscous_friction, model.motor_viscous_friction
    np.testing.assert_array_equal(np.concatenate(others), x[22:28])
    assert [(e.effect, e.joint, *e.parameters.values()) for e in model.effects] == [
        ("stribeck_friction", "b", 29.0, 30.0),
        ("torque_delay", None, 31.0),
    ]
    np.testing.assert_allclose(layout.vector(model), x)
    np.testing.assert_allclose(Layout(("a", "b")).vector(model), x[:28])
    assert not layout.vector(replace(model, effects=()))[28:].any()


def test_samples_of_the_equation():
    """At least eight per cycle of a zero-phase bandwidth, a multiple of the grid of effects where it fits."""
    time = np.arange(0, 4, 1e-3)
    segment = Segment(time, np.zeros((len(time), 1)), np.zeros((len(time), 1)), 1e-3)
    fine = fine_samples(segment)
    assert fine == int(FINE_STEP / 1e-3 + 1e-6) > 1
    assert (
        fine_samples(replace(segment, step=0.025))
        == 1
        == equation_stride(replace(segment, step=0.025), FlatZeroPhase(1.0), 0.025)
    )
    slow, fast = FlatZeroPhase(1.0), FlatZeroPhase(2 * np.pi * 25)
    assert equation_stride(segment, slow, 0.025) == 25 - 25 % fine
    assert equation_stride(segment, fast, 0.025) == 5 - 5 % fine
    assert equation_stride(segment, fast, 0.025, exact_step=True) == 25 - 25 % fine
    assert equation_stride(segment, slow, 1e-3) == 1 == equation_stride(segment, slow, 1e-4)
    assert equation_stride(segment, make_observer("eso", 2 * np.pi * 25), 0.025) == 25 - 25 % fine


@pytest.mark.parametrize(("motor", "link"), [(0.9, 1.1), (0.1, 0.1), (1e-4, 2.0), (1e-7, 1e-7)])
def test_viscous_scale_has_its_slopes(motor: float, link: float) -> None:
    layout = Layout(("a",))
    x = np.zeros(layout.size)
    x[layout.motor_viscous], x[layout.link_viscous] = motor, link
    value, *slopes = viscous_scale(layout, x, 0)
    assert value == max(motor, LEAST_VISCOUS_SHARE * (motor + link), LEAST_VISCOUS)
    for where, slope in zip((layout.motor_viscous, layout.link_viscous), slopes, strict=True):
        up = x.copy()
        up[where] += 1e-9
        assert (viscous_scale(layout, up, 0)[0] - value) / 1e-9 == pytest.approx(slope, abs=1e-5)


@pytest.mark.parametrize(("theta", "tau"), [(1e-6, 1e-5), (1e-9, 4e-3), (2e-6, 1e-9), (3e-5, 1e-9)])
def test_torque_band_lets_as_much_noise_through_as_it_may(theta: float, tau: float) -> None:
    """The noise of s and of the link velocity, summed over frequency: allowed in the band, not beyond."""
    inertia, stiffness, scale = 1.3, 2000.0 if theta < 1e-5 else 1e7, 40.0

    def allowed(hertz: float) -> bool:
        f = np.linspace(0.0, hertz, 4001)
        w = 2 * np.pi * f
        power = 2 * (tau**2 + (inertia * theta * w**2) ** 2)
        torque, rate = (np.sqrt(np.trapezoid(p, f)) for p in (power, power * w**2 / stiffness**2))
        return bool(torque < TORQUE_NOISE * scale and rate < LINK_VELOCITY_NOISE)

    one = np.ones(1)
    (band,) = torque_band(theta * one, tau * one, inertia * one, stiffness * one, scale * one, 200.0)
    assert 2.0 < band < 200.0 and allowed(0.999 * band) and not allowed(1.1 * band)
