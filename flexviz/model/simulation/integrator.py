"""Forward dynamics of both sides of the robot, integrated in time.

    link    q̈ = ABA(q, q̇, τ_j + τ_ext − f_l)
    motor   θ̈ = B⁻¹ (τ − f_m − τ_j)
    joint   τ_j = K (θ − q)   or ElasticJoint

The integrator is the classical Runge–Kutta method of order 4 with the motor torque held over a call. Arrays
are allocated once and functions bound to local names, because this is the innermost loop of every simulation.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexviz.model.simulation.plant import Array, Plant
from flexviz.robot._pinocchio import pin

Advance = Callable[[Array, float, float, int], None]

RK4_WEIGHTS = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0


def stepper(plant: Plant, x: Array) -> Advance:
    """A function advance(τ (n,), t, duration, substeps) that integrates the state `x` in place."""
    external = np.zeros(plant.n)
    contacts = plant.contacts
    stage, scratch, slopes = np.zeros(len(x)), np.zeros(len(x)), np.zeros((4, len(x)))
    first, second, third, fourth = (
        _derivative(plant, y, k, external) for y, k in zip((x, stage, stage, stage), slopes, strict=True)
    )
    add, multiply, dot = np.add, np.multiply, np.dot

    def advance(tau: Array, t: float, duration: float, substeps: int) -> None:
        h = duration / substeps
        half = 0.5 * h
        for s in range(substeps):
            now = t + s * h
            if contacts:
                external[:] = 0.0
                for i, torque, start, end in contacts:
                    overlap = min(end, now + h) - max(start, now)
                    if overlap > 0.0:
                        external[i] += torque * overlap / h
            first(tau, now)
            multiply(slopes[0], half, out=scratch)
            add(x, scratch, out=stage)
            second(tau, now + half)
            multiply(slopes[1], half, out=scratch)
            add(x, scratch, out=stage)
            third(tau, now + half)
            multiply(slopes[2], h, out=scratch)
            add(x, scratch, out=stage)
            fourth(tau, now + h)
            dot(RK4_WEIGHTS, slopes, out=scratch)
            multiply(scratch, h, out=scratch)
            add(x, scratch, out=x)

    return advance


def _derivative(plant: Plant, y: Array, rate: Array, external: Array) -> Callable[[Array, float], None]:
    """A function of τ (n,) and t that writes the time derivative of the state `y` into `rate`.

    `external` (n,) is the torque of contacts on the link [Nm].
    """
    n = plant.n
    four, q, qv, velocities = y[: 4 * n], y[:n], y[2 * n : 3 * n], y[2 * n : 4 * n]
    positions, link_acceleration, motor_acceleration = rate[: 2 * n], rate[2 * n : 3 * n], rate[3 * n : 4 * n]
    force = np.zeros(3 * n)  # link torque, motor torque, joint torque [Nm]
    link, motor = force[:n], force[n : 2 * n]
    linear, add_laws = _linear_part(plant), _laws(plant, y, rate, force, external)
    inverse: Array = np.linalg.inv(plant.motor_inertia)
    diagonal = np.count_nonzero(plant.motor_inertia - np.diag(np.diag(plant.motor_inertia))) == 0
    apply = np.multiply if diagonal else np.dot
    weight = np.ascontiguousarray(np.diag(inverse)) if diagonal else inverse
    model, data, aba, add, dot = plant.model, plant.model.createData(), pin.aba, np.add, np.dot

    def derivative(tau: Array, t: float) -> None:
        positions[:] = velocities
        dot(linear, four, out=force)
        if add_laws is not None:
            add_laws(t)
        link_acceleration[:] = aba(model, data, q, qv, link)
        add(motor, tau, out=motor)
        apply(weight, motor, out=motor_acceleration)

    return derivative


def _laws(
    plant: Plant, y: Array, rate: Array, force: Array, external: Array
) -> Callable[[float], None] | None:
    """A function of t that adds the torques of all laws at the state `y` to `force`; None without any law."""
    n, extra, contacts = plant.n, plant.extra, plant.contacts
    link, motor, carried = force[:n], force[n : 2 * n], force[2 * n :]
    motor_laws, link_laws, coupled_laws = plant.motor_laws, plant.link_laws, plant.coupled_laws
    elastic = list(plant.elastic.items())
    if not (motor_laws or link_laws or coupled_laws or elastic or contacts or extra):
        return None

    def add_laws(t: float) -> None:
        values = y.tolist()
        for i, law in elastic:
            torque = law.torque(values[n + i], values[i], values[3 * n + i], values[2 * n + i])
            carried[i] = torque
            link[i] += torque
            motor[i] -= torque
        if extra:
            for i, at, pull in plant.pulls(t, values, carried):
                carried[i] += pull.joint
                link[i] += pull.joint - pull.link
                motor[i] -= pull.joint + pull.motor
                rate[at : at + len(pull.rates)] = pull.rates
        for i, law in link_laws:
            link[i] -= law(t, values[i], values[2 * n + i])
        for i, law in motor_laws:
            motor[i] -= law(t, values[n + i], values[3 * n + i], carried[i])
        for i, k, law in coupled_laws:
            torque = law(values[3 * n + i], values[3 * n + k])
            motor[i] -= torque
            motor[k] -= torque
        if contacts:
            np.add(link, external, out=link)

    return add_laws


def _linear_part(plant: Plant) -> Array:
    """(3n, 4n): x -> [τ_j − f_lv q̇, −τ_j − f_mv θ̇, τ_j], without joints that have their own law."""
    n = plant.n
    spring = plant.stiffness.copy()
    spring[list(plant.elastic)] = 0.0
    matrix = np.zeros((3, n, 4, n))
    i = np.arange(n)
    for row, sign in ((0, 1.0), (1, -1.0), (2, 1.0)):
        matrix[row, i, 0, i] = -sign * spring
        matrix[row, i, 1, i] = sign * spring
    matrix[0, i, 2, i] = -plant.link_viscous
    matrix[1, i, 3, i] = -plant.motor_viscous
    return matrix.reshape(3 * n, 4 * n)
