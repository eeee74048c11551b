"""The Cramér–Rao bound of the raw data with unknown controller: no unbiased estimator has less spread.

What is known: records θ_m = θ + n_θ and τ_m = τ + n_τ, white noise of known size, and the equations. The
controller is unknown, so every torque is a nuisance parameter that only τ_m tells about. Put τ = τ_m − n_τ:
the plant is driven by a known torque and by white process noise, the initial state is unknown. With S the
sensitivity of θ to the parameters at fixed torque and G that to the torques, the information is Sᵀ (σ_θ² 1 +
σ_τ² G Gᵀ)⁻¹ S. A Kalman filter along the true motion whitens exactly that: the information is the sum over
the samples of eᵀ V⁻¹ e, e the innovations of the sensitivities and V their covariance. The initial state
enters as further parameters and is eliminated.

    M δq̈ = K (δθ − δq) + (θ − q) δK − Y δβ − L₀ δq − (L₁ + f_l) δq̇ − q̇ δf_l
    B δθ̈ = −K (δθ − δq) − (θ − q) δK − f_m δθ̇ − θ̇ δf_m − θ̈ δB + δτ

L₀, L₁: derivatives of the rigid-body torque by q and q̇. Nothing here comes from the identification equation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexviz.model.simulation import Run
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot

Array = NDArray[np.float64]

TERMS = 8  # of the exponential series


@dataclass(frozen=True, eq=False)
class Linear:
    """A linear time-varying system of n joints and p parameters.

    δx_{k+1} = Φ_k δx_k + Γ_k δp + Δ_k δτ_k,  δθ_k = C δx_k

    Attributes:
        transition: shape (N, 4n, 4n), Φ; the state is (q, q̇, θ, θ̇).
        parameters: shape (N, 4n, p), Γ.
        torque: shape (N, 4n, n), Δ.
    """

    transition: Array
    parameters: Array
    torque: Array


def linearise(
    robot: Robot,
    model: FlexibleModel,
    bodies: Sequence[PayloadBody],
    run: Run,
    columns: Sequence[int],
    stride: int = 1,
) -> Linear:
    """The plant along a true motion; torques are held over each step, the coefficients taken at its middle.

    Args:
        robot: joints in Pinocchio's order.
        model: true parameters.
        bodies: payload.
        run: the motion without noise, one sample a controller cycle.
        columns: leading parameters (indices into Γ) of the base inertial parameters.
        stride: controller cycles a step.

    Returns:
        with parameters in the order base inertial, K, B, f_l, f_m.
    """
    n = robot.n
    assert np.array_equal(robot.order, np.arange(n)) and not model.effects
    step = stride * float(run.time[1] - run.time[0])
    plant = robot.model_with(model.inertial, bodies)
    data = plant.createData()
    signals = (run.q, run.q_velocity, run.theta, run.theta_velocity)
    q, v, theta, w = (0.5 * (x[::stride][:-1] + x[::stride][1:]) for x in signals)
    motor_acceleration = np.diff(run.theta_velocity[::stride], axis=0) / step
    deflection = theta - q
    carried = model.stiffness * deflection - model.link_viscous_friction * v
    count, base = len(q), len(columns)
    link, motor = slice(n, 2 * n), slice(3 * n, 4 * n)
    rate = np.zeros((count, 4 * n, 4 * n))
    forcing = np.zeros((count, 4 * n, base + 4 * n))
    joint = np.arange(n)
    rate[:, joint, n + joint] = rate[:, 2 * n + joint, 3 * n + joint] = 1.0
    stiffness, viscous = np.diag(model.stiffness), np.diag(model.link_viscous_friction)
    for k in range(count):
        acceleration = pin.aba(plant, data, q[k], v[k], carried[k])
        regressor = pin.computeJointTorqueRegressor(plant, data, q[k], v[k], acceleration)[:, columns]
        dq, dv, mass = pin.computeRNEADerivatives(plant, data, q[k], v[k], acceleration)
        right = np.concatenate(
            (-dq - stiffness, -dv - viscous, stiffness, -regressor, np.diag(deflection[k]), np.diag(-v[k])),
            axis=1,
        )
        solved = np.linalg.solve(np.triu(mass) + np.triu(mass, 1).T, right)
        rate[k, link, : 3 * n] = solved[:, : 3 * n]
        forcing[k, link, : base + n] = solved[:, 3 * n : 4 * n + base]
        forcing[k, link, base + 2 * n : base + 3 * n] = solved[:, 4 * n + base :]
    inverse = 1 / model.motor_inertia
    rate[:, motor, :n] = np.diag(inverse * model.stiffness)
    rate[:, motor, 2 * n : 3 * n] = np.diag(-inverse * model.stiffness)
    rate[:, motor, 3 * n :] = np.diag(-inverse * model.motor_viscous_friction)
    forcing[:, 3 * n + joint, base + joint] = -inverse * deflection
    forcing[:, 3 * n + joint, base + n + joint] = -inverse * motor_acceleration
    forcing[:, 3 * n + joint, base + 3 * n + joint] = -inverse * w
    drive = np.zeros((4 * n, n))
    drive[motor] = np.diag(inverse)
    return discretise(rate, forcing, drive, step)


def discretise(rate: Array, forcing: Array, drive: Array, step: float) -> Linear:
    """Φ = e^(Ah), Γ = ∫e^(As)ds F, Δ = ∫e^(As)ds b: exact for coefficients constant over each step."""
    size = rate.shape[1]
    power = np.broadcast_to(np.eye(size), rate.shape)
    transition, integral = np.zeros_like(rate), np.zeros_like(rate)
    for i in range(TERMS):
        transition += power / factorial(i)
        integral += power * (step / factorial(i + 1))
        power = power @ rate * step
    return Linear(transition, integral @ forcing, integral @ drive)


def information(systems: Sequence[Linear], theta_noise: ArrayLike, torque_noise: ArrayLike) -> Array:
    """Fisher information of the parameters, shape (p, p), with unknown initial states.

    Args:
        systems: equally long records, one a group.
        theta_noise, torque_noise: standard deviations of a sample, shape (n,) or one number [rad], [Nm].
    """
    transition = np.stack([s.transition for s in systems], axis=1)  # (N, G, 4n, 4n)
    gamma = np.stack([s.parameters for s in systems], axis=1)
    delta = np.stack([s.torque for s in systems], axis=1)
    count, groups, size, p = gamma.shape
    n = size // 4
    measured = slice(2 * n, 3 * n)
    noise = np.diag(np.broadcast_to(np.square(theta_noise), n))
    process = (delta * np.broadcast_to(np.square(torque_noise), n)) @ delta.transpose(0, 1, 3, 2)

    covariance = np.zeros((groups, size, size))
    error = np.zeros((groups, size, p + size))  # sensitivities less what the filter knows of them
    error[:, :, p:] = np.eye(size)
    total = np.zeros((groups, p + size, p + size))
    for k in range(count + 1):
        innovation = error[:, measured]
        inverse = np.linalg.inv(covariance[:, measured, measured] + noise)
        weighted = inverse @ innovation
        total += innovation.transpose(0, 2, 1) @ weighted
        if k == count:
            break
        column = covariance[:, :, measured]
        error = transition[k] @ (error - column @ weighted)
        error[:, :, :p] += gamma[k]
        covariance = covariance - column @ inverse @ column.transpose(0, 2, 1)
        covariance = transition[k] @ covariance @ transition[k].transpose(0, 2, 1) + process[k]
        covariance = 0.5 * (covariance + covariance.transpose(0, 2, 1))
    known, start = total[:, :p, :p], total[:, p:, p:]
    cross = total[:, :p, p:]
    scale = 1 / np.sqrt(np.maximum(np.einsum("gii->gi", start), 1e-300))
    scaled = start * scale[:, :, None] * scale[:, None, :]
    reduced = (cross * scale[:, None, :]) @ np.linalg.pinv(scaled, rcond=1e-13, hermitian=True)
    return (known - reduced @ (cross * scale[:, None, :]).transpose(0, 2, 1)).sum(axis=0)


def covariance_bound(fisher: Array) -> Array:
    """The inverse of the information, shape (p, p), scaled so that units do not matter."""
    scale = 1 / np.sqrt(np.diag(fisher))
    return np.linalg.inv(fisher * scale[:, None] * scale) * scale[:, None] * scale
