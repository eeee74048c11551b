"""The independent simulator against closed forms, energy, textbook dynamics, half steps and its timing."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest
from scipy.linalg import expm

pytest.importorskip("mujoco")

from independent import simulator
from independent.arms import Arm, Body, Link, planar_arm, urdf_arm, urdf_text
from independent.cases import ROBOTS, draw, make_case
from independent.hiding import KINDS
from independent.laws import STRANGE, Effect, Laws
from independent.mujoco_robot import Links
from independent.simulator import Clockwork, Motion, Setup, simulate

from flexviz.robot._pinocchio import pin

ROTOR = Body(1.0, (0.0, 0.0, 0.0), (0.5, 0.5, 0.8, 0.0, 0.0, 0.0))
K, B, J = 300.0, 0.4, 0.8


def one_joint(
    *effects: Effect, stiffness: float = K, friction: tuple[float, float] = (0.0, 0.0), **more
) -> Setup:
    """A disc about a vertical axis, and its motor."""
    disc = Link("disc", "j", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), ROTOR)
    one = np.ones(1)
    still = Motion(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    setup = Setup(
        Arm("disc", (disc,)), stiffness * one, B * one, friction[0] * one, friction[1] * one, effects,
        ("p1",), ((),), still, 0 * one, 0 * one, 0.0, 1.0, (0.0, 0.0),
    )  # fmt: skip
    return replace(setup, **more)


def free(setup: Setup, y: np.ndarray, h: float, steps: int, torque: float = 0.0) -> np.ndarray:
    """The state after some steps under a constant torque."""
    work = Clockwork(setup)
    for k in range(steps):
        y = work.held(k * h, y, h, np.full(y.shape[1], torque))
    return y


def test_nothing_in_it_comes_from_flexviz() -> None:
    for path in (Path(__file__).parents[1] / "independent").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(n.split(".")[0] in {"flexviz", "pinocchio"} for n in names), path


def test_two_masses_vibrate_at_their_closed_form() -> None:
    y = free(one_joint(), np.array([[0.0], [0.1], [0.0], [0.0], [0.0]]), 5e-4, 400)
    omega, centre = np.sqrt(K / B + K / J), 0.1 * B / (B + J)
    assert y[1, 0] == pytest.approx(centre + 0.1 * J / (B + J) * np.cos(0.2 * omega), abs=1e-8)
    assert y[0, 0] == pytest.approx(centre - centre * np.cos(0.2 * omega), abs=1e-8)


def test_linear_effects_against_the_matrix_exponential() -> None:
    damping, cable, rest, offset, torque = 0.6, 40.0, 0.3, 0.7, 2.0
    setup = one_joint(
        Effect("joint_damping", 0, {"damping": damping}),
        Effect("cable_spring", 0, {"stiffness": cable, "rest_angle": rest}),
        Effect("torque_offset", 0, {"offset": offset}),
        friction=(0.3, 0.5),
    )
    start = np.array([0.05, 0.1, -0.4, 0.2])
    y = free(setup, np.array([*start, 0.0])[:, None], 5e-4, 600, torque)
    a = np.array([
        [0, 0, 1, 0, 0], [0, 0, 0, 1, 0],
        [-(K + cable) / J, K / J, -(damping + 0.3) / J, damping / J, cable * rest / J],
        [K / B, -K / B, damping / B, -(damping + 0.5) / B, (torque - offset) / B], [0, 0, 0, 0, 0],
    ])  # fmt: skip
    np.testing.assert_allclose(y[:4, 0], (expm(0.3 * a) @ [*start, 1.0])[:4], atol=1e-8)


def test_energy_of_motors_springs_and_links_stays() -> None:
    setup = draw(5, "stiffness_hardening", "2r", duration=0.1).setup
    setup = replace(setup, link_viscous=np.zeros(2), motor_viscous=np.zeros(2))
    work = Clockwork(setup)
    cubic = np.zeros(8)
    for at, p in work.laws.each("stiffness_hardening"):
        cubic[at] = p["cubic_stiffness"]

    def energy(y: np.ndarray) -> float:
        x = y[1] - y[0]
        springs = 0.5 * work.laws.stiffness * x**2 + 0.25 * cubic * x**4
        return setup.links.energy(y[0], y[2]) + float(np.sum(0.5 * work.laws.inertia * y[3] ** 2 + springs))

    y = work.start(0.0)
    y[1] += 0.02
    first = energy(y)
    last = energy(free(setup, y, 2.5e-4, 2000))
    assert abs(last - first) < 1e-6 and np.ptp(y[1] - y[0]) > 0.01


def test_links_against_the_textbook_arm() -> None:
    rng = np.random.default_rng(3)
    arm = planar_arm(rng)
    tilt = 0.2  # about y: the arm's plane sees it as an angle
    load = Body(1.7, (0.4, 0.0, -0.03), (0.01, 0.01, 0.01, 0.0, 0.0, 0.0))
    links = Links(arm, [[load]], (0.0, tilt))
    q, v, a = rng.normal(size=(3, 2))

    def moments(bodies: list[Body]) -> tuple[float, complex, float]:
        """Mass, first moment x + iz and inertia about the joint."""
        first = sum(b.mass * complex(b.com[0], b.com[2]) for b in bodies)
        return (
            sum(b.mass for b in bodies),
            complex(first),
            sum(b.inertia[1] + b.mass * abs(complex(b.com[0], b.com[2])) ** 2 for b in bodies),
        )

    (_, s1, i1), (m2, s2, i2) = moments([arm.links[0].body]), moments([arm.links[1].body, load])
    length, turn = 0.5, np.exp(1j * q[1])
    c, s = length * (s2 * turn).real, length * (s2 * turn).imag
    # angles count upwards, a turn of the base about +y downwards
    up = 9.81 * np.exp(1j * (q[0] - tilt))
    elbow = (s2 * turn * up).real
    want = [
        (i1 + i2 + m2 * length**2 + 2 * c) * a[0] + (i2 + c) * a[1] - s * (2 * v[0] * v[1] + v[1] ** 2)
        + ((s1 + m2 * length) * up).real + elbow,
        (i2 + c) * a[0] + i2 * a[1] + s * v[0] ** 2 + elbow,
    ]  # fmt: skip
    np.testing.assert_allclose(links.torque(q, v, a), want, rtol=1e-9)
    np.testing.assert_allclose(links.acceleration(q, v, np.array(want)), a, atol=1e-9)


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_links_are_those_of_the_written_urdf(name: str) -> None:
    arm = urdf_arm(name)
    links = Links(arm, [[]])
    model = pin.buildModelFromXML(urdf_text(arm))
    assert list(model.names)[1:] == list(arm.joints)
    q, v, a = np.random.default_rng(1).normal(size=(3, len(arm.joints)))
    np.testing.assert_allclose(links.torque(q, v, a), pin.rnea(model, model.createData(), q, v, a), rtol=1e-6)


@pytest.mark.parametrize("kind", ["stribeck_friction", "torque_delay"])
def test_halving_the_step_changes_nothing_that_noise_would_not_hide(kind: str) -> None:
    setup = draw(1, kind, "2r", duration=0.3).setup
    full, half = simulate(setup), simulate(setup, setup.step() / 2)
    assert np.abs(full.theta - half.theta).max() < 0.03 * setup.noise[0]
    assert np.abs(full.tau - half.tau).max() < 0.15 * setup.noise[1]


@pytest.mark.parametrize("gain, delay", [(0.0, 0.0), (0.2, 0.0), (0.0, 0.0013), (-0.1, 0.0004)])
def test_recorded_torque_begins_to_act_at_its_row(gain: float, delay: float) -> None:
    """A motor alone moves in parabolas: each second difference tells which torque acted when."""
    h = 0.001
    effects = (Effect("torque_gain", 0, {"gain_error": gain}), Effect("torque_delay", None, {"delay": delay}))
    swing = Motion(np.zeros(1), np.full((1, 1), 0.3), np.full((1, 1), 20.0), np.zeros((1, 1)))
    alone = one_joint(
        *effects, stiffness=1e-9, motion=swing, hold=h, kp=np.full(1, 400.0), kd=np.full(1, 20.0)
    )
    record = simulate(replace(alone, duration=0.2), h / 10)
    theta, tau = record.theta[0, :, 0], record.tau[0, :, 0]
    fine = np.repeat(tau, 10) * (1 + gain)  # ten values a row: what acts, before the delay
    acts = np.roll(fine, round(delay / h * 10))
    # ∬ acts over two rows, weighted by a triangle
    triangle = np.concatenate([np.arange(10) + 0.5, 9.5 - np.arange(10)]) * (h / 10) ** 2
    for row in range(20, 180):
        window = acts[10 * (row - 1) : 10 * (row + 1)]
        assert theta[row + 1] - 2 * theta[row] + theta[row - 1] == pytest.approx(
            float(triangle @ window) / B, abs=1e-12
        )


def test_without_a_hold_the_torque_is_the_controllers_at_that_moment() -> None:
    setup = draw(2, "none", "2r", hold=0.0, duration=0.05).setup
    work = Clockwork(setup)
    record = simulate(setup)
    reference = record.reference[:, 1:-1]
    speed = (record.theta[:, 2:] - record.theta[:, :-2]) / 0.002
    wanted = (record.reference[:, 2:] - record.reference[:, :-2]) / 0.002
    expected = setup.kp * (reference - record.theta[:, 1:-1]) + setup.kd * (wanted - speed)
    np.testing.assert_allclose(record.tau[:, 1:-1], expected, atol=1e-3 * work.kd.max())


def laws(*effects: Effect) -> Laws:
    two = np.array([1.0, 2.0])
    return Laws(1, 100 * two, two, 0.1 * two, 0.2 * two, effects)


@pytest.mark.parametrize(
    "name, values, extra",
    [
        ("coulomb_friction", {"coulomb": 3.0}, -3.0),
        ("stribeck_friction", {"stribeck": 3.0, "velocity": 0.5}, -3.0 * np.exp(-0.64)),
        ("quadratic_friction", {"quadratic": 3.0}, -3.0 * 0.16),
        ("load_dependent_friction", {"coefficient": 0.1}, -1.6),
        ("friction_drift", {"relative_rise": 1.5, "time_constant": 4.0}, 0.4 * -0.4 * 1.5 * np.exp(-0.5)),
        ("torque_ripple", {"amplitude": 2.0, "order": 7.0, "phase": 0.3}, 2.0 * np.sin(7 * 0.25 + 0.3)),
        ("torque_offset", {"offset": 2.0}, 2.0),
        ("presliding_hysteresis", {"presliding_stiffness": 60.0, "coulomb": 3.0}, 60.0 * 0.03),
    ],
)
def test_motor_laws(name: str, values: dict[str, float], extra: float) -> None:
    theta, v, joint, z = (np.array(x) for x in ([0.0, 0.25], [0.0, -0.4], [0.0, -16.0], [0.0, 0.03]))
    got = laws(Effect(name, 1, values)).motor(2.0, theta, v, joint, z)
    np.testing.assert_allclose(got, [0.0, 0.4 * -0.4 + extra], rtol=1e-12)


def test_joint_laws_together() -> None:
    """x = deadzone(θ + a sin(nθ+φ) − q, b), τ_j = K x + k₃ x³ + D ẋ."""
    theta, q = np.array([0.25, 0.3]), np.array([0.25, 0.2])
    v, q_velocity = np.array([0.0, 0.7]), np.array([0.0, 0.4])
    all_four = laws(
        Effect("transmission_error", 1, {"amplitude": 0.01, "order": 3.0, "phase": 0.2}),
        Effect("backlash", 1, {"half_width": 0.02}),
        Effect("stiffness_hardening", 1, {"cubic_stiffness": 5e4}),
        Effect("joint_damping", 1, {"damping": 4.0}),
    )
    x = 0.1 + 0.01 * np.sin(0.9 + 0.2) - 0.02
    rate = 0.7 * (1 + 0.03 * np.cos(0.9 + 0.2)) - 0.4
    want = 200 * x + 5e4 * x**3 + 4 * rate
    np.testing.assert_allclose(all_four.spring(theta, v, q, q_velocity), [0.0, want], rtol=1e-12)
    assert all_four.spring(theta, v, theta - 0.01, q_velocity)[1] == 0.0  # inside the gap nothing is felt


def test_bristles_follow_dahls_closed_form() -> None:
    friction = laws(Effect("presliding_hysteresis", 0, {"presliding_stiffness": 60.0, "coulomb": 3.0}))
    z, h, v = np.zeros(2), 1e-4, np.array([0.2, 0.2])
    for _ in range(5000):
        middle = z + h / 2 * friction.bristle_rate(v, z)
        z = z + h * friction.bristle_rate(v, middle)
    assert z[0] == pytest.approx(3 / 60 * (1 - np.exp(-60 / 3 * 0.1)), rel=1e-6) and z[1] == 0.0


def test_neighbours_rotor_and_contacts() -> None:
    coupled = laws(Effect("motor_coupling", 1, {"inertia": 0.3}))
    a = coupled.motor_acceleration(np.array([0.5, 1.0]))
    np.testing.assert_allclose([a[0], 2 * a[1] + 0.3 * a[0]], [0.5, 1.0])
    touched = laws(Effect("external_contact", 1, {"torque": 4.0, "start": 1.0, "end": 2.0}, run=0))
    push = touched.pushed(0.9, 1.1)
    assert push is not None
    np.testing.assert_allclose(push, [0.0, 2.0])


def test_a_set_is_what_was_simulated(tmp_path: Path) -> None:
    truth = make_case(4, "payload_error", "2r", tmp_path, duration=0.3, hold=0.0005, noise=1.0)
    case = draw(4, "payload_error", "2r", duration=0.3, hold=0.0005, noise=1.0)
    assert case.truth == truth
    table = parquet.read_table(tmp_path / "g2.parquet").to_pydict()
    np.testing.assert_array_equal(table["theta_joint2"], case.record.theta[1, :, 1])
    np.testing.assert_array_equal(table["tau_joint1"], case.record.tau[1, :, 0])
    assert set(table) == {"time", "theta_joint1", "theta_joint2", "tau_joint1", "tau_joint2"}
    clean = simulate(case.setup)
    assert np.std(case.record.theta - clean.theta) == pytest.approx(2e-5, rel=0.1)
    assert np.std(case.record.tau - clean.tau) == pytest.approx(2e-3, rel=0.1)
    drawn, real = case.drawn.links[1].body, case.setup.arm.links[1].body
    assert 0.001 < abs(drawn.mass / real.mass - 1) < 0.19


@pytest.mark.parametrize("number, kind", [*enumerate((*KINDS, *STRANGE, "none"))])
def test_every_kind_can_be_simulated(number: int, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "WARM_UP", 0.05)
    case = draw(7, kind, ROBOTS[number % 3], duration=0.02)
    assert np.isfinite(case.record.theta).all() and np.isfinite(case.record.tau).all()
    assert [e["kind"] for e in case.truth["effects"]] == ([] if kind == "none" else [kind])
