"""IDIM-IV: instruments are the regressor of a simulated robot (Janot, Vandanjon, Gautier 2014)."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.peers.closed_loop import simulate
from benchmarks.peers.derivatives import inner, rigid_band, smooth
from benchmarks.peers.methods.idim_ls import EVERY, system
from benchmarks.peers.problem import Array, Group, Problem
from benchmarks.peers.rigid import RigidModel

STEPS = 10
TOLERANCE = 0.025  # relative change of the simulated torque at which the papers stop


def simulated(model: RigidModel, x: Array, group: Group, like: int) -> Array:
    """The regressor of the simulated robot at the samples of `system`, through the same filter."""
    time, *states = simulate(model, x, group)
    step = 0.004
    coarse = np.arange(group.time[0], time[-1], step)
    states = [np.stack([np.interp(coarse, time, c) for c in s.T], axis=1) for s in states]
    y = model.regressor(*states)
    flat = smooth(y.reshape(len(y), -1), rigid_band(model.problem), step)
    kept = inner(group, EVERY)
    at = group.time[0] + group.step * np.arange(kept.start, kept.stop, kept.step)[:like]
    rows = [np.interp(at, coarse, column) for column in flat.T]
    return np.stack(rows, axis=1).reshape(len(at), *y.shape[1:])


def estimate(problem: Problem) -> dict[str, Any]:
    """From the URDF's values until the parameters change no more."""
    model = RigidModel(problem)
    parts = [system(model, group) for group in problem.fitted]
    y, tau = (np.concatenate(part) for part in zip(*parts, strict=True))
    x = model.start
    for count in range(1, STEPS + 1):
        pairs = zip(problem.fitted, parts, strict=True)
        z = np.concatenate([simulated(model, x, group, len(part[0])) for group, part in pairs])
        before, x = x, model.solve(y, tau, z)
        change = np.linalg.norm(y @ (x - before)) / np.linalg.norm(tau)
        if change < TOLERANCE:
            return model.answer(x, evaluations=1 + count)
    return model.answer(x, evaluations=1 + STEPS, converged=False)
