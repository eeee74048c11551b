"""Every effect in a whole simulation against its closed form, written down here once more.

The motor's balance over one controller cycle of length h, in which τ is constant and the rest nearly so:
    B (θ̇(t+h) − θ̇(t)) = h (τ − mean(f_m + τ_j))
and the link's, with inverse dynamics and central differences: M q̈ + C q̇ + g = τ_j + τ_ext − f_l.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.model.simulation import PDController, Run, Sinusoid, simulate_run
from flexviz.model.simulation.effect_laws import LAWS
from flexviz.model.simulation.presets import planar_inertial
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot

H = 0.00025
K, B = np.array([1000.0, 1100.0]), np.array([2.45, 1.55])
LINK, MOTOR = np.array([1.0, 1.4]), np.array([0.8, 0.66])
JOINT = "joint2"
BODY = PayloadBody("link2", 1.5, [0.7, 0.1, 0.0], [0.01, 0.02, 0.03, 0.0, 0.0, 0.0])

Array = np.ndarray


def sign(v: Array) -> Array:
    return np.tanh(v / 0.005)


# effect, parameters, torque on the motor of joint 2 as a function of (t, θ, θ̇, τ_j, all θ̈)
MOTOR_CASES: list[tuple[str, dict[str, float], Callable[..., Array]]] = [
    ("coulomb_friction", {"coulomb": 4.0}, lambda t, x, v, load, acc: 4.0 * sign(v)),
    (
        "stribeck_friction",
        {"stribeck": 3.0, "velocity": 0.2},
        lambda t, x, v, load, acc: 3.0 * np.exp(-((v / 0.2) ** 2)) * sign(v),
    ),
    ("quadratic_friction", {"quadratic": 2.0}, lambda t, x, v, load, acc: 2.0 * v * np.abs(v)),
    ("directional_friction", {"directional": 0.5}, lambda t, x, v, load, acc: 0.5 * np.abs(v)),
    (
        "thinning_friction",
        {"thinning": 1.5, "velocity": 0.1},
        lambda t, x, v, load, acc: 1.5 * np.arcsinh(v / 0.1),
    ),
    (
        "load_dependent_friction",
        {"coefficient": 0.2},
        lambda t, x, v, load, acc: 0.2 * np.abs(load) * sign(v),
    ),
    (
        "driving_friction",
        {"motor_driving": 0.2, "load_driving": 0.3},
        lambda t, x, v, load, acc: (0.25 * np.abs(load) - 0.05 * np.sign(v) * load) * sign(v),
    ),
    (
        "friction_drift",
        {"relative_rise": 2.0, "time_constant": 0.5},
        lambda t, x, v, load, acc: 0.66 * v * 2.0 * np.exp(-t / 0.5),
    ),
    (
        "temperature_friction",
        {"viscous_fall": 0.01, "coulomb_fall": 0.05},
        lambda t, x, v, load, acc: -25.0 * (0.01 * v + 0.05 * sign(v)),
    ),
    (
        "torque_ripple",
        {"amplitude": 2.0, "order": 9.0, "phase": 0.3},
        lambda t, x, v, load, acc: 2.0 * np.sin(9.0 * x + 0.3),
    ),
    ("torque_offset", {"offset": -3.0}, lambda t, x, v, load, acc: np.full_like(v, -3.0)),
    ("motor_coupling", {"inertia": 0.5}, lambda t, x, v, load, acc: 0.5 * acc[:, 0]),
]
LINK_CASES: list[tuple[str, dict[str, float], Callable[..., Array]]] = [
    ("link_coulomb_friction", {"coulomb": 4.0}, lambda t, q, v: 4.0 * sign(v)),
    ("cable_spring", {"stiffness": 15.0, "rest_angle": 0.2}, lambda t, q, v: 15.0 * (q - 0.2)),
    (
        "gravity_compensator",
        {"sine": 6.0, "cosine": -4.0},
        lambda t, q, v: 6.0 * np.sin(q) - 4.0 * np.cos(q),
    ),
    (
        "external_contact",
        {"torque": 5.0, "start": 0.5, "end": 0.8},
        lambda t, q, v: np.where((t >= 0.5) & (t < 0.8), -5.0, 0.0),
    ),
]
JOINT_CASES: list[tuple[str, dict[str, float], Callable[..., Array]]] = [
    (
        "stiffness_hardening",
        {"cubic_stiffness": 2e6},
        lambda x, q, v, w: 1100 * (x - q) + 2e6 * (x - q) ** 3,
    ),
    (
        "backlash",
        {"half_width": 0.003},
        lambda x, q, v, w: 1100 * (x - q - np.clip(x - q, -0.003, 0.003)),
    ),
    ("joint_damping", {"damping": 4.0}, lambda x, q, v, w: 1100 * (x - q) + 4.0 * (v - w)),
    (
        "transmission_error",
        {"amplitude": 0.002, "order": 7.0, "phase": 0.4},
        lambda x, q, v, w: 1100 * (x + 0.002 * np.sin(7.0 * x + 0.4) - q),
    ),
]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("robots:planar_2r")


def run_with(robot: Robot, *effects: EffectValue, duration: float = 1.1, payload: str = "p1") -> Run:
    model = FlexibleModel(robot.joints, K, B, LINK, MOTOR, planar_inertial(), effects)
    return simulate_run(
        robot,
        model,
        payload=() if payload == "p1" else (BODY,),
        reference=Sinusoid(0.6, 3.0),
        controller=PDController(1e4, 500.0, H),
        duration=duration,
        start="moving",
        group="g1",
        payload_name=payload,
        temperature=(5.0, 45.0),
        step=H / 2,
    )


def motor_rest(run: Run, tau: Array | None = None) -> Array:
    """(N − 1, n) what opposes the motors beside viscous friction and τ_j, mean over each cycle [Nm]."""
    f = MOTOR * run.theta_velocity + run.tau_joint
    tau = run.tau if tau is None else tau
    return tau[:-1] - 0.5 * (f[1:] + f[:-1]) - B * np.diff(run.theta_velocity, axis=0) / H


def link_rest(robot: Robot, run: Run, model: object | None = None) -> Array:
    """(N − 2, n) what opposes the links beside viscous friction [Nm]."""
    model = robot.model_with(planar_inertial()) if model is None else model
    data = model.createData()  # type: ignore[attr-defined]
    q, v = run.q[1:-1], run.q_velocity[1:-1]
    a = (run.q_velocity[2:] - run.q_velocity[:-2]) / (2 * H)
    needed = np.array([pin.rnea(model, data, *row).copy() for row in zip(q, v, a, strict=True)])
    return run.tau_joint[1:-1] - LINK * v - needed


def middle(x: Array) -> Array:
    return 0.5 * (x[1:] + x[:-1])


def close(found: Array, expected: Array, tolerance: float) -> None:
    """Equal but for a hundredth of the samples (reversals, where one cycle is too long for a mean)."""
    error = np.sort(np.abs(found - expected))
    assert error[int(0.99 * len(error))] < tolerance, error[int(0.99 * len(error))]


@pytest.mark.parametrize(("name", "parameters", "law"), MOTOR_CASES, ids=[c[0] for c in MOTOR_CASES])
def test_motor_law(robot: Robot, name: str, parameters: dict[str, float], law: Callable[..., Array]) -> None:
    run = run_with(robot, EffectValue(name, JOINT, parameters))
    t, x, v, load = (
        middle(s) for s in (run.time, run.theta[:, 1], run.theta_velocity[:, 1], run.tau_joint[:, 1])
    )
    expected = law(t, x, v, load, np.diff(run.theta_velocity, axis=0) / H)
    rest = motor_rest(run)
    close(rest[:, 1], expected, 0.01)
    close(rest[:, 0], 0.0 * t, 0.01)
    assert np.abs(expected).max() > 0.3


@pytest.mark.parametrize(("name", "parameters", "law"), LINK_CASES, ids=[c[0] for c in LINK_CASES])
def test_link_law(robot: Robot, name: str, parameters: dict[str, float], law: Callable[..., Array]) -> None:
    run = run_with(robot, EffectValue(name, JOINT, parameters))
    expected = law(run.time[1:-1], run.q[1:-1, 1], run.q_velocity[1:-1, 1])
    rest = link_rest(robot, run)
    close(rest[:, 1], expected, 0.01)
    close(rest[:, 0], 0.0 * expected, 0.01)
    close(motor_rest(run)[:, 1], 0.0 * run.time[1:], 0.01)
    assert np.abs(expected).max() > 1.0


@pytest.mark.parametrize(("name", "parameters", "law"), JOINT_CASES, ids=[c[0] for c in JOINT_CASES])
def test_joint_law(robot: Robot, name: str, parameters: dict[str, float], law: Callable[..., Array]) -> None:
    run = run_with(robot, EffectValue(name, JOINT, parameters))
    expected = law(run.theta[:, 1], run.q[:, 1], run.theta_velocity[:, 1], run.q_velocity[:, 1])
    np.testing.assert_allclose(run.tau_joint[:, 1], expected, atol=1e-8)
    np.testing.assert_allclose(run.tau_joint[:, 0], K[0] * (run.theta - run.q)[:, 0], atol=1e-8)
    assert np.abs(expected - K[1] * (run.theta - run.q)[:, 1]).max() > 0.1
    close(motor_rest(run)[:, 1], 0.0 * run.time[1:], 0.01)
    close(link_rest(robot, run)[:, 1], 0.0 * run.time[2:], 0.01)


def test_presliding_is_dahl(robot: Robot) -> None:
    sigma, coulomb = 2000.0, 5.0
    run = run_with(
        robot,
        EffectValue("presliding_hysteresis", JOINT, {"presliding_stiffness": sigma, "coulomb": coulomb}),
        duration=2.5,
    )
    rest, v = motor_rest(run)[:, 1], middle(run.theta_velocity[:, 1])
    z, expected = 0.0, np.empty(len(v))
    for k, speed in enumerate(v):  # the same ODE by the exact solution for constant speed
        decay = np.exp(-abs(speed) * sigma / coulomb * H)
        final = np.sign(speed) * coulomb / sigma
        new = final + (z - final) * decay
        expected[k], z = sigma * 0.5 * (z + new), new
    close(rest, expected, 0.03)
    assert np.abs(expected).max() == pytest.approx(coulomb, rel=0.01)


def test_startup_friction_fades_along_the_path(robot: Robot) -> None:
    values = {"startup": 6.0, "angle": 0.08}
    run = run_with(robot, EffectValue("startup_friction", JOINT, values), duration=2.5)
    rest, v = motor_rest(run)[:, 1], middle(run.theta_velocity[:, 1])
    left, expected = 1.0, np.empty(len(v))
    for k, speed in enumerate(v):  # the part that is left, exact for constant speed
        wear, healing = abs(speed) / 0.08, 10.0 * np.exp(-((speed / 0.005) ** 2))
        final = healing / (wear + healing)
        new = final + (left - final) * np.exp(-H * (wear + healing))
        expected[k], left = 6.0 * 0.5 * (left + new) * sign(speed), new
    close(rest, expected, 0.03)
    assert np.abs(expected).max() > 5.0 and np.abs(expected[len(v) // 3 :]).max() < 1.0
    close(motor_rest(run)[:, 0], 0.0 * v, 0.01)


@pytest.mark.parametrize("joint", ["joint1", "joint2"])
def test_coupled_friction_is_the_same_on_both_motors(robot: Robot, joint: str) -> None:
    run = run_with(robot, EffectValue("coupled_friction", joint, {"coulomb": 3.0, "viscous": 2.0}))
    both = middle(run.theta_velocity.sum(axis=1))
    rest = motor_rest(run)
    for i in (0, 1):
        close(rest[:, i], 3.0 * sign(both) + 2.0 * both, 0.01)
    close(np.abs(link_rest(robot, run)).max(axis=1), 0.0 * run.time[2:], 0.01)
    assert both.min() < -0.3 and both.max() > 0.3


def test_torque_gain_and_delay(robot: Robot) -> None:
    run = run_with(robot, EffectValue("torque_gain", JOINT, {"gain_error": 0.1}))
    rest = motor_rest(run, run.tau * [1.0, 1.1])
    close(rest[:, 1], 0.0 * rest[:, 1], 0.01)

    for cycles in (4.0, 3.6):
        run = run_with(robot, EffectValue("torque_delay", None, {"delay": cycles * H}))
        whole, part = int(cycles), cycles - int(cycles)
        early = np.roll(run.tau, whole + 1, axis=0)  # acts in the first `part` of a cycle
        applied = part * early + (1 - part) * np.roll(run.tau, whole, axis=0)
        rest = motor_rest(run, applied)[200:]
        close(rest[:, 1], 0.0 * rest[:, 1], 0.02)
    one = run_with(robot, EffectValue("torque_delay", "joint1", {"delay": 2 * H}))
    applied = np.column_stack([np.roll(one.tau[:, 0], 2), one.tau[:, 1]])
    rest = motor_rest(one, applied)[200:]
    close(np.abs(rest).max(axis=1), 0.0 * rest[:, 0], 0.02)


def test_the_record_stands_at_a_torque_limit_and_the_motor_gets_all(robot: Robot) -> None:
    free = run_with(robot)
    limit = 0.7 * float(np.abs(free.tau[:, 1]).max())
    run = run_with(robot, EffectValue("torque_limit", JOINT, {"limit": limit}))
    np.testing.assert_array_equal(run.theta, free.theta)
    np.testing.assert_array_equal(run.tau[:, 0], free.tau[:, 0])
    np.testing.assert_array_equal(run.tau[:, 1], np.clip(free.tau[:, 1], -limit, limit))
    none = run_with(robot, EffectValue("torque_limit", JOINT, {"limit": 0.0}))
    np.testing.assert_array_equal(none.tau, free.tau)


def test_payload_error(robot: Robot) -> None:
    effect = EffectValue("payload_error", None, {"relative_mass_error": 0.2}, payload="p2")
    heavier = PayloadBody("link2", 1.2 * BODY.mass, BODY.com, 1.2 * BODY.inertia)
    run = run_with(robot, effect, payload="p2")
    rest = link_rest(robot, run, robot.model_with(planar_inertial(), [heavier]))
    close(np.abs(rest).max(axis=1), 0.0 * rest[:, 0], 0.01)
    other = run_with(robot, effect, payload="p1")
    np.testing.assert_array_equal(other.tau, run_with(robot).tau)


def test_base_tilt(robot: Robot) -> None:
    x, y = 0.05, -0.08
    run = run_with(robot, EffectValue("base_tilt", None, {"tilt_x": x, "tilt_y": y}))
    rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    gravity = ((ry @ rx).T @ [0.0, 0.0, -9.81]).tolist()
    rest = link_rest(robot, run, robot.model_with(planar_inertial(), gravity=gravity))
    close(np.abs(rest).max(axis=1), 0.0 * rest[:, 0], 0.01)
    assert np.abs(link_rest(robot, run)).max() > 0.3


def test_effects_of_other_groups_do_nothing(robot: Robot) -> None:
    effect = EffectValue("external_contact", JOINT, {"torque": 50.0, "start": 0.0, "end": 9.0}, group="g2")
    np.testing.assert_array_equal(run_with(robot, effect).tau, run_with(robot).tau)


def test_every_effect_name_is_here() -> None:
    from flexviz.model.effects.names import EFFECT_NAMES

    tested = {case[0] for case in (*MOTOR_CASES, *LINK_CASES, *JOINT_CASES)}
    alone = {"presliding_hysteresis", "torque_gain", "torque_delay", "payload_error", "base_tilt"}
    alone |= {"coupled_friction", "startup_friction", "torque_limit"}
    assert tuple(LAWS) == EFFECT_NAMES
    assert tested | alone == set(EFFECT_NAMES)


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (EffectValue("coulomb", JOINT, {}), 'effect "coulomb" does not exist'),
        (EffectValue("coulomb_friction", "joint9", {"coulomb": 1.0}), 'joint "joint9" does not exist'),
        (EffectValue("coulomb_friction", JOINT, {"fc": 1.0}), 'no parameter "fc"; valid: coulomb'),
        (EffectValue("coulomb_friction", JOINT, {}), 'parameter "coulomb" is missing'),
    ],
)
def test_bad_effects(robot: Robot, effect: EffectValue, message: str) -> None:
    with pytest.raises(InputError, match=message):
        run_with(robot, effect)
