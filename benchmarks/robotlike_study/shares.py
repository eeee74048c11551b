"""How large each hidden effect is: its torque along the true motion, by the simulator's own law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.model.effects import JointState
from flexviz.model.simulation import ExtraLaw, Plan, PlannedGroup, Run, make_plant
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import EffectValue
from flexviz.robot.robot import PayloadBody

Array = NDArray[np.float64]


def effect_torque(plan: Plan, group: PlannedGroup, run: Run, effect: EffectValue) -> Array:
    """(N,) torque of one effect of the library along a motion without sensor noise [Nm].

    Motor and link effects: the law's torque. Effects in the joint: the change of the torque that the link
    needs, as with the same motor motion the link moves differently. A wrong torque scale: what is recorded
    less than what acts.
    """
    payload = plan.payloads[group.payload]
    alone = replace(plan.model, effects=(effect,))
    plant, _ = make_plant(plan.robot, alone, payload, group=group.name, payload_name=group.payload)
    assert effect.joint is not None
    i = plan.robot.joints.index(effect.joint)
    theta, speed, q, q_speed, load = (
        x[:, i].tolist() for x in (run.theta, run.theta_velocity, run.q, run.q_velocity, run.tau_joint)
    )
    time = run.time.tolist()
    if effect.effect == "torque_gain":
        return -effect.parameters["gain_error"] * run.tau[:, i]
    if plant.motor_laws:
        law = plant.motor_laws[0][1]
        return np.array([law(*row) for row in zip(time, theta, speed, load, strict=True)])
    if plant.link_laws:
        link_law = plant.link_laws[0][1]
        return np.array([link_law(*row) for row in zip(time, q, q_speed, strict=True)])
    if plant.presliding:
        return _dahl(run.theta[:, i], effect.parameters)
    if plant.extra:
        return law_torque(plan, run, effect.joint, plant.extra[0][1])
    return _through_the_link(plan, payload, run, i, _link_shift(effect, plan, run, i))


def law_torque(plan: Plan, run: Run, joint: str, law: ExtraLaw) -> Array:
    """(N,) torque of a law along a motion, its states by Euler's rule [Nm]."""
    i = plan.robot.joints.index(joint)
    columns = (run.time, *(x[:, i] for x in (run.theta, run.theta_velocity, run.q, run.q_velocity)))
    rows = zip(*(x.tolist() for x in (*columns, run.tau_joint[:, i])), strict=True)
    step, states, out = float(run.time[1] - run.time[0]), np.zeros(law.states), []
    for row in rows:
        pull = law.pull(JointState._make((*row, states.tolist())))
        out.append(pull.motor + pull.link + pull.joint)
        states = states + step * np.array(pull.rates)
    return np.array(out)


def share(torque: Array, spread: float) -> dict[str, float]:
    """Rms of a torque (N,) [Nm], and that over the spread [Nm] of its joint's torque."""
    rms = float(np.sqrt(np.mean(torque**2)))
    return {"torque_rms": rms, "share": rms / float(spread)}


def _dahl(theta: Array, p: dict[str, float]) -> Array:
    """Friction σz of Dahl's model, exact for motion in one direction between two samples."""
    stiffness, coulomb = p["presliding_stiffness"], p["coulomb"]
    torque, out = 0.0, [0.0]
    for step in np.diff(theta).tolist():
        end = coulomb if step > 0 else -coulomb
        torque = end + (torque - end) * float(np.exp(-abs(step) * stiffness / coulomb))
        out.append(torque)
    return np.array(out)


def _link_shift(effect: EffectValue, plan: Plan, run: Run, i: int) -> Array:
    """(N,) how far the effect moves the link while motor position and joint torque stay the same [rad]."""
    p, stiffness = effect.parameters, float(plan.model.stiffness[i])
    if effect.effect == "transmission_error":
        return p["amplitude"] * np.sin(p["order"] * run.theta[:, i] + p["phase"])
    deflection_rate = run.theta_velocity[:, i] - run.q_velocity[:, i]
    if effect.effect == "joint_damping":
        return p["damping"] / stiffness * deflection_rate
    if effect.effect == "stiffness_hardening":
        x = run.tau_joint[:, i] / stiffness
        linear = x.copy()
        for _ in range(50):
            x = x - (stiffness * x + p["cubic_stiffness"] * x**3 - stiffness * linear) / (
                stiffness + 3 * p["cubic_stiffness"] * x**2
            )
        return linear - x
    raise ValueError(f'no share is known for "{effect.effect}"')


def _through_the_link(plan: Plan, payload: tuple[PayloadBody, ...], run: Run, i: int, shift: Array) -> Array:
    """(N,) torque on joint i that the link needs less without the `shift` (N,) of its position [Nm]."""
    robot = plan.robot
    model = robot.model_with(plan.model.inertial, payload)
    data = model.createData()
    moved = np.zeros_like(run.q)
    moved[:, i] = shift
    rate = np.gradient(moved, run.time, axis=0)
    acceleration = np.gradient(run.q_velocity, run.time, axis=0)
    with_it = (run.q, run.q_velocity, acceleration)
    without = (run.q - moved, run.q_velocity - rate, acceleration - np.gradient(rate, run.time, axis=0))
    torques = []
    for motion in (with_it, without):
        rows = zip(*(robot.to_pin(x) for x in motion), strict=True)
        torques.append(robot.from_pin(np.array([pin.rnea(model, data, *row).copy() for row in rows]))[:, i])
    return torques[0] - torques[1]
