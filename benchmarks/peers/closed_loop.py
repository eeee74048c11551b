"""Closed-loop simulation of the rigid robot, for instruments (IDIM-IV) and for output error (DIDIM).

With the set's own controller and commanded angles where it has them; else with a PD controller of 20 Hz on
the measured angle, kept at that bandwidth when the parameters change (the "gain updating" of DIDIM).
"""

from __future__ import annotations

import numpy as np

from benchmarks.peers.derivatives import smooth
from benchmarks.peers.problem import COULOMB, OFFSET, Array, Group
from benchmarks.peers.rigid import SMOOTH, RigidModel, pin

STEP = 0.0005  # [s]
BANDWIDTH = 2 * np.pi * 20  # [rad/s] of the PD controller where the set has none
HERTZ = 20.0  # of the filter on the measured angle where the set has no commanded one


def simulate(model: RigidModel, x: Array, group: Group) -> tuple[Array, Array, Array, Array]:
    """Time (N,) and q, q̇, q̈ (N, n) of the simulated robot with the parameters x."""
    n, problem = model.n, model.problem
    robot = model.pin.copy()
    for i, row in enumerate(x[: 10 * n].reshape(n, 10) + group.payload):
        robot.inertias[1 + i] = pin.Inertia.FromDynamicParameters(row)
    robot.armature = x[10 * n : 11 * n]
    data = robot.createData()
    viscous = x[11 * n : 12 * n]
    rest = x[12 * n :].reshape(-1, n)
    coulomb = rest[0] if COULOMB in problem.effects else np.zeros(n)
    offset = rest[-1] if OFFSET in problem.effects else np.zeros(n)
    time = np.arange(group.time[0], group.time[-1], STEP)
    known = group.reference is not None and problem.kp is not None and problem.kd is not None
    wanted = group.reference if known else smooth(group.theta, HERTZ, group.step)
    assert wanted is not None
    speed = np.gradient(wanted, group.step, axis=0)
    place, rate = (
        np.stack([np.interp(time, group.time, column) for column in array.T], axis=1)
        for array in (wanted, speed)
    )
    inertia = np.diag(pin.crba(robot, data, place[0]))
    kp = problem.kp if known else inertia * BANDWIDTH**2
    kd = problem.kd if known else 2 * inertia * BANDWIDTH
    q, v = (group.theta[0] if known else place[0]).copy(), (np.zeros(n) if known else rate[0].copy())
    states = np.empty((3, len(time), n))
    for k in range(len(time)):
        friction = viscous * v + coulomb * np.tanh(v / SMOOTH) + offset
        a = pin.aba(robot, data, q, v, kp * (place[k] - q) + kd * (rate[k] - v) - friction)
        states[:, k] = q, v, a
        v = v + STEP * a
        q = q + STEP * v
    if not np.isfinite(states).all():
        raise FloatingPointError("the simulated robot diverges with these parameters")
    return time, states[0], states[1], states[2]
