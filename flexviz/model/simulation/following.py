"""The run of a smooth reference in large steps: quick enough to compare thousands of references.

    link    M q̈ + h(q, q̇) + f_l = s + τ_ext,   s = K (θ + shift − q)
    motor   B θ̈ + f_mv θ̇ + s = k_p (θ_d − θ) + k_d (θ̇_d − θ̇),   τ = B θ̈ + f_m + s

The trapezoidal rule, which is stable for joints of any stiffness, with M and h of a predicted state. The
motor's effects add their torque to τ but do not move the motor. Left out: joint damping, hardening in the
motion (hardening and backlash enter q afterwards), and states of friction other than presliding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import lapack

from flexviz.model.simulation import starting
from flexviz.model.simulation.building import make_plant
from flexviz.model.simulation.control import PDController
from flexviz.model.simulation.plant import Array, Plant
from flexviz.model.simulation.references import Reference
from flexviz.model.simulation.run import Run
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot


def follow(
    robot: Robot,
    model: FlexibleModel,
    reference: Reference,
    time: Array,
    controller: PDController,
    *,
    payload: Sequence[PayloadBody] = (),
    payload_name: str | None = None,
    group: str | None = None,
) -> Run:
    """The run at `time` (N,), uniform [s], starting at rest; each torque is that of the same instant.

    Steps of up to a twentieth of the slowest vibration's period will do.
    """
    plant, path = make_plant(robot, model, payload, group=group, payload_name=payload_name)
    wanted, speed = (robot.to_pin(level) for level in reference.sample(time))
    q, theta, qv, velocity, acceleration = _motion(robot, plant, controller, time, wanted, speed)
    load = plant.stiffness * (theta + _shift(plant, theta) - q)
    for i, joint in plant.elastic.items():
        q[:, i] -= [joint.opening(value) - value / joint.stiffness for value in load[:, i].tolist()]
    torque = load + acceleration @ plant.motor_inertia.T + plant.motor_viscous * velocity
    torque += _motor_laws(plant, time, theta, velocity, load)
    if path.delay.any():
        early = [np.interp(time + d, time, column) for d, column in zip(path.delay, torque.T, strict=True)]
        torque = np.stack(early, axis=1)
    found = (theta, velocity, q, qv, torque / (1.0 + path.gain_error), load, wanted)
    return Run(time, *(robot.from_pin(level) for level in found), torque_hold=0.0)


def _shift(plant: Plant, theta: Array) -> Array:
    """Transmission error, (N, n) [rad]."""
    shift = np.zeros_like(theta)
    for i, joint in plant.elastic.items():
        shift[:, i] = [joint.shift(value) for value in theta[:, i].tolist()]
    return shift


def _motion(
    robot: Robot, plant: Plant, controller: PDController, time: Array, wanted: Array, speed: Array
) -> tuple[Array, ...]:
    """q, θ, q̇, θ̇, θ̈, (N, n) each, for the motor reference `wanted` and its `speed` (N, n)."""
    n, step = plant.n, float(time[1] - time[0])
    kp, kd = (robot.to_pin(np.broadcast_to(gain, n)) for gain in (controller.kp, controller.kd))
    spring = np.diag(np.tile(plant.stiffness, 2))
    spring[:n, n:] = spring[n:, :n] = -np.diag(plant.stiffness)
    spring[n:, n:] += np.diag(kp)
    damping = np.concatenate((plant.link_viscous, plant.motor_viscous + kd))
    half = 0.5 * step
    implicit = half * half * spring + np.diag(half * damping)
    implicit[n:, n:] += plant.motor_inertia
    pulled = np.concatenate((np.zeros_like(wanted), kp * wanted + kd * speed), axis=1)
    offset = plant.stiffness * _shift(plant, wanted)
    pulled += np.concatenate((offset, -offset), axis=1)
    model, data, mass, bias = plant.model, plant.model.createData(), pin.crba, pin.rnea
    solve = lapack.dposv  # pyright: ignore[reportAttributeAccessIssue]
    laws, still = bool(plant.link_laws or plant.contacts), np.zeros(n)
    x = starting.at_rest(plant, wanted[0], kp)[0][: 2 * n]
    v, a = np.zeros(2 * n), np.zeros(2 * n)
    out = np.empty((3, len(time), 2 * n))
    for k, force in enumerate(pulled):
        if k:
            ahead, fast = x + step * v + half * half * a, v + half * a
            q, qv = ahead[:n] + half * half * a[:n], fast[:n] + half * a[:n]
            rest = force - spring @ ahead - damping * fast
            rest[:n] -= bias(model, data, q, qv, still)
            if laws:
                rest[:n] -= _link_laws(plant, float(time[k]), q, qv)
            matrix = implicit.copy()
            matrix[:n, :n] += mass(model, data, q)
            a = solve(matrix, rest)[1]
            x, v = ahead + half * half * a, fast + half * a
        out[:, k] = x, v, a
    return out[0, :, :n], out[0, :, n:], out[1, :, :n], out[1, :, n:], out[2, :, n:]


def _link_laws(plant: Plant, time: float, q: Array, velocity: Array) -> Array:
    """Torque of the link's effects, (n,) [Nm]."""
    out = np.zeros_like(q)
    for i, law in plant.link_laws:
        out[i] += law(time, float(q[i]), float(velocity[i]))
    for i, torque, start, end in plant.contacts:
        out[i] -= torque * (start <= time < end)
    return out


def _motor_laws(plant: Plant, time: Array, theta: Array, velocity: Array, load: Array) -> Array:
    """Torque of the motor's effects, (N, n) [Nm]."""
    out = np.zeros_like(theta)
    for i, law in plant.motor_laws:
        columns = (time, theta[:, i], velocity[:, i], load[:, i])
        out[:, i] += [law(*row) for row in zip(*(c.tolist() for c in columns), strict=True)]
    for i, k, coupled in plant.coupled_laws:
        pairs = zip(velocity[:, i].tolist(), velocity[:, k].tolist(), strict=True)
        torque = np.array([coupled(*pair) for pair in pairs])
        out[:, i] += torque
        out[:, k] += torque
    for i, law in plant.presliding:
        decay = law.presliding_stiffness / law.coulomb
        z, states = 0.0, []
        for step in np.diff(theta[:, i], prepend=theta[0, i]).tolist():
            limit = np.sign(step) / decay  # exact solution of dz/dθ = 1 − sign(θ̇) z σ/f_c over one step
            z = limit + (z - limit) * np.exp(-decay * abs(step))
            states.append(law.presliding_stiffness * z)
        out[:, i] += states
    return out
