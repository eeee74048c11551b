"""Initial states: static equilibrium, or motion that does not excite the elastic joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebvander

from flexviz.model.simulation.plant import Array, Plant
from flexviz.robot._pinocchio import pin


def at_rest(plant: Plant, theta_ref: Array, kp: Array) -> tuple[Array, Array]:
    """The state at rest in which the PD holds the arm near θ_d (n,), and the PD's torque (n,) [Nm].

    Link: g(q) + f_l(q, 0) = τ_j. Motor: τ = τ_j + f_m(θ, 0). PDController: τ = k_p (θ_d − θ).
    """
    n = plant.n
    data = plant.model.createData()
    theta, q, tau = theta_ref.copy(), theta_ref.copy(), np.zeros(n)
    x = plant.empty_state()
    for _ in range(200):
        load = pin.computeGeneralizedGravity(plant.model, data, q).copy()
        for i, law in plant.link_laws:
            load[i] += law(0.0, float(q[i]), 0.0)
        for i, torque, start, end in plant.contacts:
            load[i] -= torque * (start <= 0.0 < end)
        x[:n], x[n : 2 * n] = q, theta
        own = plant.pulls(0.0, x.tolist(), load)
        for i, _, pull in own:
            load[i] += pull.link
        new, extra = load.copy(), np.zeros(n)
        for i, _, pull in own:
            new[i] += pull.motor
            extra[i] += pull.joint
        for i, law in plant.motor_laws:
            new[i] += law(0.0, float(theta[i]), 0.0, float(load[i]))
        theta_new = theta_ref - np.where(kp > 0, new / np.where(kp > 0, kp, 1.0), 0.0)
        shift = [
            plant.joint(i).shift(float(theta_new[i])) - plant.joint(i).opening(float(load[i] - extra[i]))
            for i in range(n)
        ]
        q_new = theta_new + np.array(shift)
        change = np.abs(q_new - q).max() + np.abs(theta_new - theta).max()
        theta, q, tau = theta_new, q_new, new
        if change < 1e-14:
            break
    x[:n], x[n : 2 * n] = q, theta
    return x, tau


def moving(plant: Plant, motion: Callable[[Array], Array], width: float = 0.2, degree: int = 8) -> Array:
    """The state at t = 0 with the motors on θ = `motion`(t) (M, n) and the links following without ringing.

    The link follows the slow motion: starting with q = θ, torque by inverse dynamics and q = θ + error −
    opening(τ_j) are iterated three times, with derivatives of the Chebyshev polynomial of `degree` on
    −width … width [s]. More iterations diverge, as each adds two derivatives. The backlash gap is added last.
    """
    n = plant.n
    data = plant.model.createData()
    nodes = -np.cos(np.pi * np.arange(degree + 1) / degree)
    time = width * nodes
    # (M, M) from values at the nodes to the polynomial's derivatives there
    slope = chebvander(nodes, degree - 1) @ chebder(np.linalg.inv(chebvander(nodes, degree))) / width
    middle = degree // 2
    theta = motion(time)
    shift = np.zeros_like(theta)
    for i, joint in plant.elastic.items():
        shift[:, i] = [joint.shift(float(value)) for value in theta[:, i]]
    joints = [replace(plant.joint(i), half_width=0.0) for i in range(n)]
    q = theta + shift
    torque = np.zeros_like(q)
    for _ in range(3):
        qv = slope @ q
        qa = slope @ qv
        torque = np.array([pin.rnea(plant.model, data, *row).copy() for row in zip(q, qv, qa, strict=True)])
        torque += plant.link_viscous * qv
        for i, law in plant.link_laws:
            rows = zip(time.tolist(), q[:, i].tolist(), qv[:, i].tolist(), strict=True)
            torque[:, i] += [law(*row) for row in rows]
        opening = [[joint.opening(s) for s in torque[:, i].tolist()] for i, joint in enumerate(joints)]
        q = theta + shift - np.array(opening).T
    x = plant.empty_state()
    gaps = np.array([plant.joint(i).half_width for i in range(n)]) * np.sign(torque[middle])
    x[:n], x[n : 2 * n] = q[middle] - gaps, theta[middle]
    x[2 * n : 3 * n] = (slope @ q)[middle]
    x[3 * n : 4 * n] = (slope @ theta)[middle]
    return x
