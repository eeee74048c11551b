"""DIDIM: closed-loop output error on the torque alone (Gautier, Janot, Vandanjon 2013), rigid."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.peers.derivatives import inner, rigid_band, smooth, torque_at_samples
from benchmarks.peers.methods.idim_iv import STEPS, TOLERANCE, simulated
from benchmarks.peers.methods.idim_ls import EVERY
from benchmarks.peers.problem import Problem
from benchmarks.peers.rigid import RigidModel


def estimate(problem: Problem) -> dict[str, Any]:
    """Least squares on the regressor of the simulated robot, simulated again with the result."""
    model = RigidModel(problem)
    measured = []
    for group in problem.fitted:
        tau = smooth(torque_at_samples(group, problem.hold), rigid_band(problem), group.step)
        measured.append(tau[inner(group, EVERY)])
    x = model.start
    for count in range(1, STEPS + 1):
        rows = [simulated(model, x, g, len(m)) for g, m in zip(problem.fitted, measured, strict=True)]
        triples = zip(problem.fitted, measured, rows, strict=True)
        torque = [m - model.payload_torque(g, y) for g, m, y in triples]
        y, tau = np.concatenate(rows), np.concatenate(torque)
        before, x = x, model.solve(y, tau)
        if np.linalg.norm(y @ (x - before)) < TOLERANCE * np.linalg.norm(tau):
            return model.answer(x, evaluations=count)
    return model.answer(x, evaluations=STEPS, converged=False)
