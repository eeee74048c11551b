"""Columns of two joints that are exchanged: their torques fit each other's motion."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from flexviz.importing.mapping import Issue, Mapping
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_model import Reading, TorqueModel, improvement
from flexviz.measurements import Array


def exchanged(model: TorqueModel, pair: tuple[int, int], theta_too: bool) -> TorqueModel:
    """The model with the torques of two joints exchanged; `theta_too`: also their motions."""
    order = np.arange(model.robot.n)
    order[list(pair)] = pair[::-1]
    return model.changed(lambda x: x[:, order] if theta_too else x, lambda x: x[:, order])


def check_order(mapping: Mapping, model: TorqueModel, shares: Array) -> Issue | None:
    """Two joints whose columns are probably exchanged; None if there are no such ones.

    `shares`: (n,), share of each torque that the robot's masses explain with the best other changes.
    """
    if np.min(shares) >= LIMITS.order_checked:
        return None
    as_read = Reading.unchanged(model.robot.n)
    best: tuple[float, Array, tuple[int, int], str] | None = None
    for pair in combinations(range(model.robot.n), 2):
        for signals, theta_too in (("theta and tau", True), ("tau", False)):
            tried = exchanged(model, pair, theta_too).shares(as_read, any_scale=False)
            gain = improvement(shares, tried)
            explained = np.min(tried[list(pair)]) >= LIMITS.explained_well
            if explained and gain >= LIMITS.clear and (best is None or gain > best[0]):
                best = gain, tried, pair, signals
    if best is None:
        return None
    gain, tried, pair, signals = best
    joints = tuple(mapping.names[j] for j in pair)
    now, before = (" and ".join(f"{100 * max(s[j], 0.0):.0f} %" for j in pair) for s in (tried, shares))
    message = (
        f"with the columns of {' and '.join(joints)} exchanged the robot's masses explain {now} of their "
        f"torques, otherwise at most {before}: is the order of the joints right?"
    )
    return Issue("order", "wrong" if gain >= LIMITS.exchanged else "odd", joints, signals, message)
