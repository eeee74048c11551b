"""Mix-ups that concern whole columns: gears that are stated and not used, joints that are exchanged."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from flexviz.importing.mapping import Fix, Issue, Mapping
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_model import Reading, TorqueModel, improvement
from flexviz.measurements import Array


def check_gears(mapping: Mapping, model: TorqueModel) -> Issue | None:
    """That both signals of joints with an unused gear are those of the motor; None if they are not.

    Checked first: if only θ or only τ were corrected, the other would look like a wrong unit, scale or sign.
    """
    columns = [mapping.joints[joint] for joint in mapping.names]
    unused = np.array(
        [
            abs(c.ratio) != 1.0 and c.theta.side == c.tau.side == "joint" and c.theta.offset == 0.0
            for c in columns
        ]
    )
    if not unused.any():
        return None
    as_read = Reading.unchanged(model.robot.n)
    shares = model.shares(as_read, any_scale=False)
    if np.min(shares) >= LIMITS.explained_well:
        return None
    gears = np.where(unused, [c.ratio for c in columns], 1.0)
    behind = model.changed(lambda x: x / gears, lambda x: x * gears)
    tried = behind.shares(as_read, any_scale=False)
    gained = np.where(unused, tried - shares, 0.0)
    better = gained > LIMITS.same_share
    # friction alone may explain a torque that is multiplied by a gear
    explained = np.minimum(tried, 3.0 * behind.by_masses(as_read))
    if (
        np.sum(gained) < LIMITS.gain
        or np.min(gained) < -LIMITS.same_share
        or np.min(explained[better]) < LIMITS.explained_well
    ):
        return None
    joints = tuple(joint for joint, each in zip(mapping.names, better, strict=True) if each)
    before, now = (f"{100 * max(float(np.min(s[better])), 0.0):.0f} %" for s in (shares, tried))
    message = (
        f'their gears are stated, but not used: both signals have side = "joint". With side = "motor" the '
        f"robot's masses explain at least {now} of each torque instead of {before}"
    )
    fixes = tuple(Fix(joint, signal, "side", "motor") for joint in joints for signal in ("theta", "tau"))
    return Issue("unit", "wrong", joints, "theta and tau", message, fixes)


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
