"""Gears that a mapping states and does not use: both signals come from before them."""

from __future__ import annotations

import numpy as np

from flexviz.importing.mapping import Fix, Issue, Mapping
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_model import Reading, TorqueModel
from flexviz.measurements import Array


def check_gears(mapping: Mapping, model: TorqueModel, shares: Array) -> Issue | None:
    """That angle and torque of all joints with an unused gear are those of the motor; None otherwise.

    Each fault alone would be searched for the other: a unit of θ, a scale of τ, a sign.

    Args:
        mapping: of the log.
        model: the motion and torques as the mapping reads them.
        shares: shape (n,), share of each torque that the robot's masses explain so far.
    """
    columns = [mapping.joints[joint] for joint in mapping.names]
    unused = [
        abs(c.ratio) != 1.0 and c.theta.side == c.tau.side == "joint" and c.theta.offset == 0.0
        for c in columns
    ]
    if not any(unused) or np.min(shares) >= LIMITS.explained_well:
        return None
    gears = np.array([c.ratio if each else 1.0 for c, each in zip(columns, unused, strict=True)])
    tried = model.behind(gears).shares(Reading.unchanged(model.robot.n), any_scale=False)
    if np.min(tried[unused]) < LIMITS.explained_well or np.any(tried[unused] < shares[unused]):
        return None
    joints = tuple(joint for joint, each in zip(mapping.names, unused, strict=True) if each)
    before, now = (f"{100 * max(float(np.min(s[unused])), 0.0):.0f} %" for s in (shares, tried))
    message = (
        f'their gears are stated, but not used: both signals have side = "joint". With side = "motor" the '
        f"robot's masses explain at least {now} of each torque instead of {before}"
    )
    fixes = tuple(Fix(joint, signal, "side", "motor") for joint in joints for signal in ("theta", "tau"))
    return Issue("unit", "wrong", joints, "theta and tau", message, fixes)
