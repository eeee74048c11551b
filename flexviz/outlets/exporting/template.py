"""Inverse dynamics of two elastic joints with every effect: the template of the exported Python code.

The numbers above "code:" are an example, replaced by the robot's own; sections between `# [name` and
`# name]` are left out if the robot has no such effect. flexviz itself does not use this module.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

JOINTS = ("joint1", "joint2")
JOINT = (0, 1)
PARENT = (-1, 0)
STILL = np.array([[[0, 0, 0], [0, 0, -1], [0, 0, 0]], [[0, 0, 0], [0, 0, 0], [0, 0, 1]]], dtype=float)
SINE = np.array([[[0, -1, 0], [0, 0, 0], [1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]], dtype=float)
COSINE = np.array([[[1, 0, 0], [0, 0, 0], [0, 1, 0]], [[1, 0, 0], [0, 1, 0], [0, 0, 0]]], dtype=float)
PLACE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
SLIDE = np.zeros((2, 3))
TURN = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
PUSH = np.zeros((2, 3))
MASS = np.array([1.0, 0.5])
MOMENT = np.array([[0.5, 0.0, 0.0], [0.2, 0.01, 0.0]])
INERTIA = np.array([np.diag([0.1, 0.4, 0.4]), np.diag([0.05, 0.2, 0.2])])
GRAVITY = np.array([0.0, 0.0, -9.81])
SIGN_VELOCITY = 0.005
STIFFNESS = np.array([1000.0, 1100.0])
MOTOR_INERTIA = np.array([2.0, 1.5])
MOTOR_VISCOUS = np.array([0.8, 0.6])
LINK_VISCOUS = np.array([1.0, 1.4])
CUBIC = np.array([2e5, 0.0])
HALF_WIDTH = np.array([1e-3, 0.0])
DAMPING = np.array([0.0, 2.0])
MOTOR_COULOMB = np.array([2.0, 1.0])
LINK_COULOMB = np.array([0.5, 0.0])
QUADRATIC = np.array([0.3, 0.0])
DIRECTIONAL = np.array([0.0, -0.05])
LOAD = np.array([0.0, 0.1])
OFFSET = np.array([0.4, 0.0])
GAIN_ERROR = np.array([0.05, 0.0])
TORQUE_DELAY = np.array([0.002, 0.002])
SPRING = np.array([5.0, 0.0])
SPRING_TORQUE = np.array([1.0, 0.0])
COMPENSATOR = ((0, 2.0, 1.0),)
DRIVING = ((1, 0.1, 0.15),)
THINNING = ((0, 0.4, 0.1),)
STRIBECK = ((0, 1.0, 0.1),)
RIPPLE = ((1, 0.5, 9.0, 0.7),)
ERROR = ((1, 1e-3, 7.0, 0.4),)
DRIFT = ((0, 0.6, 4.0),)
PRESLIDING = ((1, 300.0, 1.5),)
COUPLING = ((0, 1, 0.2),)
COUPLED = ((0, 1, 0.5, 0.1),)

# code:


class FeedForward(NamedTuple):
    """Commands for a desired motion of the links, each with the shape of q.

    tau: motor torque [Nm]; theta, theta_velocity: motor position [rad] and velocity [rad/s] for a position
    controller; tau_joint: torque in the elastic joints [Nm].
    """

    tau: np.ndarray
    theta: np.ndarray
    theta_velocity: np.ndarray
    tau_joint: np.ndarray


class Memory:
    """State of the presliding friction: pass the same memory at every cycle."""

    def __init__(self) -> None:
        self.theta: np.ndarray | None = None  # last motor position [rad]
        self.share = np.zeros(len(JOINTS))  # of the sliding friction, -1 ... 1


def inverse_dynamics(q, dq, ddq, d3q, d4q, time=np.inf, memory: Memory | None = None) -> FeedForward:
    """Motor torque, position and velocity for a desired motion of the links.

    q ... d4q: link positions [rad] and their four derivatives, shape (n,), or (N, n) for N instants in order.
    time: since the run began with cold gears [s], one number or (N,); infinity for warm gears.
    memory: state of the presliding friction; None: its sliding friction acts at once.
    """
    shape = np.shape(q)
    p = [_columns(x) for x in (q, dq, ddq, d3q, d4q)]
    load = _link_torque(*(np.stack(p[k : k + 3]) for k in range(3)))
    deflection = _deflection(load)
    theta = p[0] + deflection[0], p[1] + deflection[1], p[2] + deflection[2]
    # [half_width
    # the play jumps where the load changes sides; the jump is left to the controller
    theta = theta[0] + HALF_WIDTH[:, None] * np.sign(load[0]), theta[1], theta[2]
    # half_width]
    # [error
    theta = _before_error(theta)
    # error]
    tau = _motor_torque(theta, load[0], time, memory)
    return FeedForward(*(x.T.reshape(shape) for x in (tau, theta[0], theta[1], load[0])))


def rigid_inverse_dynamics(q, dq, ddq, time=np.inf, memory: Memory | None = None) -> np.ndarray:
    """Motor torque [Nm] as if the joints were rigid, for motions known up to ddq."""
    p = [_columns(x) for x in (q, dq, ddq)]
    load = _link_torque(*(np.stack((x, 0 * x, 0 * x)) for x in p))[0]
    return _motor_torque((p[0], p[1], p[2]), load, time, memory).T.reshape(np.shape(q))


def link_torque(q, dq, ddq) -> np.ndarray:
    """Torque on the links, friction on the link side included [Nm]; shapes as above."""
    p = [_columns(x) for x in (q, dq, ddq)]
    return _link_torque(*(np.stack((x, 0 * x, 0 * x)) for x in p))[0].T.reshape(np.shape(q))


def _columns(x) -> np.ndarray:
    x = np.asarray(x, dtype=float)
    if x.ndim not in (1, 2) or x.shape[-1] != len(JOINTS):
        raise ValueError(f"shape {x.shape}, expected ({len(JOINTS)},) or (N, {len(JOINTS)})")
    return x.reshape(-1, len(JOINTS)).T


# A jet is a quantity with its first and second derivative in time, stacked along the first axis.


def _product(a, b):
    return np.stack((a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2]))


def _cross(a, b):
    turned = [(1, 2), (2, 0), (0, 1)]
    return np.stack([_product(a[:, i], b[:, j]) - _product(a[:, j], b[:, i]) for i, j in turned], axis=1)


def _into(rotation, v):
    return _product(rotation, v[:, :, None]).sum(axis=1)


def _out_of(rotation, v):
    return _product(rotation, v[:, None]).sum(axis=2)


def _times(constant, jet):
    return np.asarray(constant)[..., None] * jet[:, None]


def _link_torque(q, v, a):
    """Recursive Newton-Euler on jets (3, n, N), each body in its own frame; gravity lifts the base."""
    count = q.shape[2]
    motion, poses = [], []
    base = np.zeros((4, 3, 3, count))
    base[3, 0] = -GRAVITY[:, None]
    forces = np.zeros((2, len(JOINTS), 3, 3, count))
    for b, i in enumerate(JOINT):
        s, c = np.sin(q[0, i]), np.cos(q[0, i])
        q1, q2 = q[1, i], q[2, i]
        sine = np.stack((s, c * q1, c * q2 - s * q1 * q1))
        cosine = np.stack((c, -s * q1, -s * q2 - c * q1 * q1))
        rotation = SINE[b][..., None] * sine[:, None, None] + COSINE[b][..., None] * cosine[:, None, None]
        rotation[0] += STILL[b][..., None]
        place = _times(SLIDE[b], q[:, i])
        place[0] += PLACE[b][:, None]
        poses.append((rotation, place))
        w, u, dw, du = motion[PARENT[b]] if PARENT[b] >= 0 else base
        turn, push = _times(TURN[b], v[:, i]), _times(PUSH[b], v[:, i])
        u = _into(rotation, u + _cross(w, place)) + push
        du = _into(rotation, du + _cross(dw, place)) + _times(PUSH[b], a[:, i])
        w = _into(rotation, w) + turn
        dw = _into(rotation, dw) + _times(TURN[b], a[:, i]) + _cross(w, turn)
        du = du + _cross(w, push) + _cross(u, turn)
        motion.append((w, u, dw, du))
        moment = np.zeros((3, 3, count))
        moment[0] = MOMENT[b][:, None]
        linear = MASS[b] * u + _cross(w, moment)
        angular = np.einsum("ij,kjn->kin", INERTIA[b], w) + _cross(moment, u)
        forces[0, b] = MASS[b] * du + _cross(dw, moment) + _cross(w, linear)
        forces[1, b] = np.einsum("ij,kjn->kin", INERTIA[b], dw) + _cross(moment, du)
        forces[1, b] += _cross(w, angular) + _cross(u, linear)
    torque = np.zeros(q.shape)
    for b in reversed(range(len(JOINTS))):
        i, (rotation, place) = JOINT[b], poses[b]
        torque[:, i] = np.einsum("j,kjn->kn", PUSH[b], forces[0, b]) + np.einsum(
            "j,kjn->kn", TURN[b], forces[1, b]
        )
        if PARENT[b] >= 0:
            force = _out_of(rotation, forces[0, b])
            forces[0, PARENT[b]] += force
            forces[1, PARENT[b]] += _out_of(rotation, forces[1, b]) + _cross(place, force)
    torque += LINK_VISCOUS[:, None] * v
    # [spring
    torque += SPRING[:, None] * q
    torque[0] -= SPRING_TORQUE[:, None]
    # spring]
    # [compensator
    for i, sine, cosine in COMPENSATOR:
        balance = sine * np.sin(q[0, i]) + cosine * np.cos(q[0, i])
        slope = sine * np.cos(q[0, i]) - cosine * np.sin(q[0, i])
        rates = slope * q[1, i], slope * q[2, i] - balance * q[1, i] ** 2
        torque[:, i] += np.stack((balance, *rates))
    # compensator]
    # [link_coulomb
    # dry friction jumps where a link reverses: the jump has no derivatives that a motor could follow
    torque[0] += LINK_COULOMB[:, None] * np.tanh(v[0] / SIGN_VELOCITY)
    # link_coulomb]
    return torque


def _deflection(load):
    """Deflection (3, n, N) of the joints under the torque `load` (3, n, N)."""
    # [damping
    # K x + D dx/dt = load: the series in D/K as far as the given derivatives reach
    x = _spring(load)
    for _ in range(3):
        rate = np.stack((x[1], x[2], np.zeros_like(x[0])))
        x = _spring(load - DAMPING[:, None] * rate)
    return x
    # damping]
    # [undamped
    return _spring(load)
    # undamped]


def _spring(load):
    stiffness = STIFFNESS[:, None]
    # [cubic
    cubic = CUBIC[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.sqrt(4 * stiffness / (3 * cubic))
        x = scale * np.sinh(np.arcsinh(3 * load[0] / (stiffness * scale)) / 3)
    x = np.where(cubic > 0, x, load[0] / stiffness)
    tangent = stiffness + 3 * cubic * x * x
    rate = load[1] / tangent
    return np.stack((x, rate, (load[2] - 6 * cubic * x * rate * rate) / tangent))
    # cubic]
    # [linear
    return load / stiffness
    # linear]


# [error
def _before_error(link):
    """The motor's motion whose gear, with its error, gives this motion: theta + a sin(n theta + phase)."""
    theta = link[0].copy()
    for _ in range(50):
        value, slope, _ = _with_error(theta)
        step = (value - link[0]) / slope
        theta -= step
        if np.all(np.abs(step) <= 1e-15 * (1 + np.abs(theta))):
            break
    _, slope, bend = _with_error(theta)
    speed = link[1] / slope
    return theta, speed, (link[2] - bend * speed * speed) / slope


def _with_error(theta):
    value, slope, bend = theta.copy(), np.ones_like(theta), np.zeros_like(theta)
    for i, amplitude, order, phase in ERROR:
        angle = order * theta[i] + phase
        value[i] += amplitude * np.sin(angle)
        slope[i] += amplitude * order * np.cos(angle)
        bend[i] -= amplitude * order * order * np.sin(angle)
    return value, slope, bend


# error]
def _motor_torque(theta, load, time, memory):
    """Motor torque for the motion theta (3, n, N) of the motors under the joint torque `load` (n, N)."""
    position, speed, acceleration = theta
    tau = load + MOTOR_INERTIA[:, None] * acceleration + MOTOR_VISCOUS[:, None] * speed
    # [sign
    sign = np.tanh(speed / SIGN_VELOCITY)
    # sign]
    # [motor_coulomb
    tau += MOTOR_COULOMB[:, None] * sign
    # motor_coulomb]
    # [quadratic
    tau += QUADRATIC[:, None] * speed * np.abs(speed)
    # quadratic]
    # [directional
    tau += DIRECTIONAL[:, None] * np.abs(speed)
    # directional]
    # [thinning
    for i, thinning, width in THINNING:
        tau[i] += thinning * np.arcsinh(speed[i] / width)
    # thinning]
    # [load
    tau += LOAD[:, None] * np.abs(load) * sign
    # load]
    # [driving
    for i, *shares in DRIVING:
        tau[i] += np.where(load[i] * speed[i] > 0, *shares) * np.abs(load[i]) * sign[i]
    # driving]
    # [offset
    tau += OFFSET[:, None]
    # offset]
    # [stribeck
    for i, stribeck, width in STRIBECK:
        tau[i] += stribeck * np.exp(-((speed[i] / width) ** 2)) * sign[i]
    # stribeck]
    # [ripple
    for i, amplitude, order, phase in RIPPLE:
        tau[i] += amplitude * np.sin(order * position[i] + phase)
    # ripple]
    # [drift
    for i, rise, constant in DRIFT:
        tau[i] += MOTOR_VISCOUS[i] * speed[i] * rise * np.exp(-np.asarray(time, dtype=float) / constant)
    # drift]
    # [coupling
    for i, other, inertia in COUPLING:
        tau[i] += inertia * acceleration[other]
    # coupling]
    # [coupled
    for i, other, coulomb, viscous in COUPLED:
        both = speed[i] + speed[other]
        tau[[i, other]] += coulomb * np.tanh(both / SIGN_VELOCITY) + viscous * both
    # coupled]
    # [presliding
    shares = _presliding(position, sign, memory)
    for i, _, coulomb in PRESLIDING:
        tau[i] += coulomb * shares[i]
    # presliding]
    # [gain_error
    tau /= 1 + GAIN_ERROR[:, None]
    # gain_error]
    return tau


# [presliding
def _presliding(position, sign, memory):
    """Presliding friction as a share of its sliding friction (n, N), by Dahl's law."""
    if memory is None:
        return sign
    shares = np.zeros_like(position)
    for k, now in enumerate(position.T):
        path = np.zeros(len(JOINTS)) if memory.theta is None else now - memory.theta
        for i, stiffness, coulomb in PRESLIDING:
            side = np.sign(path[i])
            fade = np.exp(-stiffness / coulomb * abs(path[i]))
            memory.share[i] = side + (memory.share[i] - side) * fade if side else memory.share[i]
        memory.theta = now.copy()
        shares[:, k] = memory.share
    return shares


# presliding]
