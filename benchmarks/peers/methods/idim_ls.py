"""IDIM-LS: the inverse dynamic model by weighted least squares (Gautier 1997)."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.peers.derivatives import differences, inner, rigid_band, smooth, torque_at_samples
from benchmarks.peers.problem import Array, Group, Problem
from benchmarks.peers.rigid import RigidModel

HERTZ = 20.0  # of the position filter
EVERY = 0.02  # [s] between the samples that are kept


def system(model: RigidModel, group: Group) -> tuple[Array, Array]:
    """Regressor (N, n, P) and torque (N, n) of one group, both through the parallel filter."""
    band = rigid_band(model.problem)  # of the parallel filter on both sides
    q, v, a = differences(smooth(group.theta, HERTZ, group.step), 2, group.step)
    coarse = max(1, round(0.004 / group.step))  # the regressor at 250 Hz is ample for 20 Hz
    y = model.regressor(q[::coarse], v[::coarse], a[::coarse])
    torque = smooth(torque_at_samples(group, model.problem.hold), band, group.step)[::coarse]
    kept = inner(group, EVERY)
    kept = slice(kept.start // coarse, kept.stop // coarse, kept.step // coarse)
    flat = smooth(y.reshape(len(y), -1), band, group.step * coarse)
    y = flat.reshape(y.shape)[kept]
    return y, torque[kept] - model.payload_torque(group, y)


def estimate(problem: Problem) -> dict[str, Any]:
    """All groups at once."""
    model = RigidModel(problem)
    parts = [system(model, group) for group in problem.fitted]
    y, tau = (np.concatenate(part) for part in zip(*parts, strict=True))
    return model.answer(model.solve(y, tau), evaluations=1)
