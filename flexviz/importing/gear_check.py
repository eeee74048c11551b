"""Gears that a mapping states and does not use: angle and torque were measured on the motor side."""

from __future__ import annotations

import numpy as np

from flexviz.importing.mapping import Fix, Issue, Mapping
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_model import Reading, TorqueModel


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
