"""The simulator against closed forms, energy, rigid-body dynamics and its own step halving."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexviz.model.simulation import PDController, Sinusoid, make_plan, random_fourier, simulate_run
from flexviz.model.simulation.building import TorquePath, make_plant
from flexviz.model.simulation.integrator import stepper
from flexviz.model.simulation.laws import ElasticJoint
from flexviz.model.simulation.loop import Loop
from flexviz.model.simulation.presets import planar_inertial
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import Robot

ROTOR = """<robot name="rotor"><link name="base"/>
  <link name="disc"><inertial><mass value="1"/>
    <inertia ixx="0.5" iyy="0.5" izz="0.8" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j" type="continuous"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/></joint>
</robot>"""
K, B, J = 300.0, 0.4, 0.8
PLANAR = ((1000.0, 1100.0), (2.45, 1.55), (1.0, 1.4), (0.8, 0.66))
PD = PDController(1e4, 500.0, 0.00025)


@pytest.fixture(scope="module")
def planar() -> Robot:
    return Robot.load("robots:planar_2r")


@pytest.fixture
def rotor(tmp_path: Path) -> Robot:
    (tmp_path / "rotor.urdf").write_text(ROTOR)
    return Robot.load("rotor.urdf", base=tmp_path)


def rotor_model(robot: Robot, *effects: EffectValue) -> FlexibleModel:
    return FlexibleModel(("j",), [K], [B], [0.0], [0.0], robot.cad_parameters, effects)  # type: ignore[arg-type]


def planar_model(robot: Robot, *effects: EffectValue, friction: float = 1.0) -> FlexibleModel:
    k, b, link, motor = (np.array(x) for x in PLANAR)
    return FlexibleModel(robot.joints, k, b, friction * link, friction * motor, planar_inertial(), effects)


def test_two_masses_vibrate_at_their_closed_form(rotor: Robot) -> None:
    plant, _ = make_plant(rotor, rotor_model(rotor))
    x = plant.empty_state()
    x[:] = [0.0, 0.1, 0.0, 0.0]
    advance = stepper(plant, x)
    omega = np.sqrt(K / B + K / J)
    for k in range(400):
        advance(np.zeros(1), k * 5e-4, 5e-4, 1)
    t = 400 * 5e-4
    centre = 0.1 * B / (B + J)
    np.testing.assert_allclose(x[1], centre + 0.1 * J / (B + J) * np.cos(omega * t), atol=1e-8)
    np.testing.assert_allclose(x[0], centre - centre * np.cos(omega * t), atol=1e-8)


def test_at_rest_the_joints_bend_under_gravity(planar: Robot) -> None:
    model = planar_model(planar)
    run = simulate_run(planar, model, reference=Sinusoid(0.3, 0.0), controller=PD, duration=0.2)
    data = planar.model.createData()
    gravity = pin.computeGeneralizedGravity(planar.model_with(model.inertial), data, run.q[0])
    np.testing.assert_allclose(run.theta[0] - run.q[0], gravity / model.stiffness, rtol=1e-12)
    np.testing.assert_allclose(run.tau[0], gravity, rtol=1e-12)
    np.testing.assert_allclose(run.q, np.broadcast_to(run.q[0], run.q.shape), atol=1e-10)


@pytest.mark.parametrize(
    "effect",
    [
        EffectValue("backlash", "joint1", {"half_width": 0.01}),
        EffectValue("stiffness_hardening", "joint1", {"cubic_stiffness": 1e6}),
        EffectValue("transmission_error", "joint1", {"amplitude": 0.01, "order": 5.0, "phase": 0.3}),
        EffectValue("cable_spring", "joint1", {"stiffness": 20.0, "rest_angle": -0.4}),
        EffectValue("torque_offset", "joint1", {"offset": 4.0}),
        EffectValue("torque_ripple", "joint1", {"amplitude": 3.0, "order": 8.0, "phase": 1.0}),
    ],
)
def test_at_rest_with_effects_nothing_moves(planar: Robot, effect: EffectValue) -> None:
    run = simulate_run(
        planar, planar_model(planar, effect), reference=Sinusoid(0.3, 0.0), controller=PD, duration=0.2
    )
    np.testing.assert_allclose(run.q, np.broadcast_to(run.q[0], run.q.shape), atol=1e-9)


def test_coulomb_friction_sticks(rotor: Robot) -> None:
    effect = EffectValue("coulomb_friction", "j", {"coulomb": 2.0})
    plant, recorder = make_plant(rotor, rotor_model(rotor, effect))
    push = np.full((8000, 1), 1.2)  # [Nm], less than the friction
    states, _ = Loop(plant, recorder, push, np.zeros(1), np.zeros(1), 0.00025).drive(
        plant.empty_state(), push[0]
    )
    creep = 0.005 * np.arctanh(1.2 / 2.0)  # [rad/s] where tanh(v / 0.005) balances the push
    np.testing.assert_allclose(states[-4000:, 3].mean(), creep, rtol=0.02)
    assert states[-1, 1] < 1.2 * creep * 2.0


def test_energy_is_kept_without_friction(planar: Robot) -> None:
    model = planar_model(planar, friction=0.0)
    plant, recorder = make_plant(planar, model)
    x = plant.empty_state()
    x[:] = [0.3, -0.8, 0.32, -0.81, 0.5, -0.4, 0.5, 0.6]
    free = np.zeros((4000, 2))
    states, _ = Loop(plant, recorder, free, np.zeros(2), np.zeros(2), 0.00025).drive(x, free[0])
    energy = total_energy(plant.model, model, states)
    assert np.ptp(energy) < 1e-7 * np.ptp(kinetic(plant.model, states))


def test_work_goes_into_energy_and_heat(planar: Robot) -> None:
    model = planar_model(planar)
    plant, _ = make_plant(planar, model)
    run = simulate_run(planar, model, reference=Sinusoid(0.7, 2.0), controller=PD, duration=1.5)
    states = np.hstack([run.q, run.theta, run.q_velocity, run.theta_velocity])
    work = np.concatenate([[0.0], np.cumsum((run.tau[:-1] * np.diff(run.theta, axis=0)).sum(axis=1))])
    loss = (
        run.q_velocity**2 @ model.link_viscous_friction + run.theta_velocity**2 @ model.motor_viscous_friction
    )
    heat = np.concatenate([[0.0], np.cumsum(0.5 * (loss[1:] + loss[:-1])) * 0.00025])
    energy = total_energy(plant.model, model, states)
    np.testing.assert_allclose(energy - energy[0], work - heat, atol=2e-3 * np.ptp(energy))
    assert heat[-1] > 0.1 * np.ptp(energy)


def test_stiff_joints_follow_rigid_inverse_dynamics(planar: Robot) -> None:
    k, b, link, motor = (np.array(x) for x in PLANAR)
    model = FlexibleModel(planar.joints, 1e4 * k, b, link, motor, planar_inertial())
    reference = Sinusoid(0.7, 2.0)
    run = simulate_run(
        planar, model, reference=reference, controller=PD, duration=1.0, start="moving", step=2.5e-5
    )
    rigid = planar.model_with(model.inertial)
    data = rigid.createData()
    acceleration = np.gradient(run.theta_velocity, run.time, axis=0)
    rows = zip(run.theta, run.theta_velocity, acceleration, strict=True)
    expected = np.array([pin.rnea(rigid, data, *row).copy() for row in rows])
    expected += b * acceleration + (link + motor) * run.theta_velocity
    late = slice(1500, -10)  # the controller's own transient is over
    error = run.tau[late] + 0.5 * np.gradient(run.tau, axis=0)[late] - expected[late]
    assert np.abs(error).max() < 0.02 * np.abs(expected).max()
    np.testing.assert_allclose(run.q, run.theta, atol=1e-5)


@pytest.mark.parametrize("start", ["rest", "moving"])
def test_step_halving_changes_nothing_visible(planar: Robot, start: str) -> None:
    kinds = {"duration": 1.0, "controller": PD, "reference": Sinusoid(1.0, 0.5 * np.pi), "start": start}
    coarse = simulate_run(planar, planar_model(planar), **kinds)
    fine = simulate_run(planar, planar_model(planar), **kinds, step=0.000125)
    assert np.abs(coarse.theta - fine.theta).max() < 1e-10
    assert np.abs(coarse.tau - fine.tau).max() < 1e-6


def test_step_halving_with_friction_and_a_panda(planar: Robot) -> None:
    effects = [EffectValue("coulomb_friction", j, {"coulomb": 4.0}) for j in planar.joints]
    effects += [EffectValue("link_coulomb_friction", j, {"coulomb": 3.0}) for j in planar.joints]
    model = planar_model(planar, *effects)
    kinds = {"duration": 0.7, "controller": PD, "reference": Sinusoid(0.7, 3.0)}  # with a reversal
    coarse = simulate_run(planar, model, **kinds)
    fine = simulate_run(planar, model, **kinds, step=0.00025 / 8)
    assert np.abs(coarse.theta - fine.theta).max() < 5e-7  # the noise is 2e-5
    plan = make_plan("panda", ["link_coulomb_friction:panda_joint7"])
    runs = [
        simulate_run(
            plan.robot,
            plan.model,
            reference=plan.groups[0].reference,
            controller=plan.controller,
            duration=0.6,
            step=step,
        )
        for step in (None, 2.5e-5)
    ]
    assert np.abs(runs[0].theta - runs[1].theta).max() < 1e-7
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-6


def test_moving_start_does_not_ring(planar: Robot) -> None:
    model = planar_model(planar, friction=0.0)
    kinds = {"reference": Sinusoid(1.0, 0.5 * np.pi), "controller": PD, "duration": 0.5}
    still = simulate_run(planar, model, **kinds, start="moving")
    jump = simulate_run(planar, model, **kinds, start="rest")
    ringing = [np.abs(np.diff(run.tau_joint, 2, axis=0)).max() for run in (still, jump)]
    assert ringing[0] < 0.02 * ringing[1]
    np.testing.assert_allclose(still.theta[0], still.theta_ref[0])
    np.testing.assert_allclose(still.theta_velocity[0], -0.5 * np.pi)


def test_joint_order_does_not_matter() -> None:
    names = [f"panda_joint{i}" for i in range(1, 8)]
    plan = make_plan("panda")
    mixed = [names[i] for i in (2, 0, 6, 1, 3, 5, 4)]
    at = [names.index(joint) for joint in mixed]
    robot = Robot.load("example-robot-data:panda", mixed)
    m = plan.model
    model = FlexibleModel(
        tuple(mixed),
        m.stiffness[at],
        m.motor_inertia[at],
        m.link_viscous_friction[at],
        m.motor_viscous_friction[at],
        m.inertial[at],
        (EffectValue("coulomb_friction", "panda_joint2", {"coulomb": 3.0}),),
    )
    from dataclasses import replace

    from flexviz.model.simulation import Sampled

    time = np.arange(0, 0.6, 0.01)
    position, _ = plan.groups[0].reference.sample(time)
    straight = simulate_run(
        plan.robot,
        replace(m, effects=model.effects),
        reference=Sampled(time, position),
        controller=plan.controller,
        duration=0.5,
    )
    shuffled = simulate_run(
        robot,
        model,
        reference=Sampled(time, position[:, at]),
        controller=PDController(plan.controller.kp[at], plan.controller.kd[at], 0.00025),
        duration=0.5,
    )
    for name in ("theta", "q", "tau", "tau_joint", "theta_ref", "q_velocity"):
        np.testing.assert_allclose(getattr(shuffled, name), getattr(straight, name)[:, at], atol=1e-8)


def test_elastic_law_and_its_inverse() -> None:
    for joint in (
        ElasticJoint(100.0),
        ElasticJoint(100.0, cubic=5e4),
        ElasticJoint(100.0, cubic=2e4, half_width=0.01),
    ):
        for torque in (-30.0, -0.5, 2.0, 40.0):
            opening = joint.opening(torque)
            assert joint.torque(opening, 0.0, 0.0, 0.0) == pytest.approx(torque, rel=1e-9)
    gap = ElasticJoint(100.0, half_width=0.01, damping=5.0)
    assert gap.torque(0.005, 0.0, 1.0, 0.0) == 0.0
    assert gap.torque(0.02, 0.0, 1.0, 0.0) == pytest.approx(100 * 0.01 + 5.0)


def test_random_fourier_stays_within_limits() -> None:
    robot = Robot.load("example-robot-data:panda", [f"panda_joint{i}" for i in range(1, 8)])
    reference = random_fourier(robot, 5, centre=[0, 0, 0, -1.5, 0, 1.5, 0], reach=3.0, duration=10.0)
    time = np.linspace(0, 10, 2001)
    position, velocity = reference.sample(time)
    assert (position >= robot.lower_limit).all() and (position <= robot.upper_limit).all()
    assert (np.abs(velocity) <= robot.velocity_limit).all()
    np.testing.assert_allclose(velocity[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.gradient(position, time, axis=0)[5:-5], velocity[5:-5], atol=2e-3)


def test_recorder_is_plain_without_sensing_effects(planar: Robot) -> None:
    _, recorder = make_plant(planar, planar_model(planar))
    assert isinstance(recorder, TorquePath) and not recorder.delay.any() and not recorder.gain_error.any()


def kinetic(model: object, states: np.ndarray) -> np.ndarray:
    data = model.createData()  # type: ignore[attr-defined]
    return np.array([pin.computeKineticEnergy(model, data, s[:2].copy(), s[4:6].copy()) for s in states])


def total_energy(model: object, parameters: FlexibleModel, states: np.ndarray) -> np.ndarray:
    data = model.createData()  # type: ignore[attr-defined]
    potential = np.array([pin.computePotentialEnergy(model, data, s[:2].copy()) for s in states])
    bend, speed = states[:, 2:4] - states[:, :2], states[:, 6:8]
    springs = 0.5 * bend**2 @ parameters.stiffness
    return kinetic(model, states) + potential + springs + 0.5 * speed**2 @ parameters.motor_inertia
