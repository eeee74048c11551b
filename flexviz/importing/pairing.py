"""Units and gear of θ and q where both are recorded: q is the joint's own angle, θ follows it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.importing.assembling import Assembled
from flexviz.importing.draft import Draft, DraftJoint
from flexviz.importing.offsets import BAND, low_pass
from flexviz.measurements import Array
from flexviz.robot import Robot

DEGREE = np.pi / 180  # [rad]
TOO_FAR = 1.3  # times the joint's range, from which an angle is not in rad
SAME = 0.98  # squared correlation of θ and q from which they are the same motion
SMALLEST_GEAR, LARGEST_GEAR = 5.0, 500.0
WHOLE = 0.3  # largest standard error with which a ratio near a whole number is taken for it
NEAR = 0.03  # relative difference to 180/π from which a ratio is no unit


def scale_pairs(draft: Draft, robot: Robot, groups: Sequence[Assembled]) -> bool:
    """Find units of q and θ, and the gear between them, of every joint; whether anything was changed."""
    changed = False
    width = robot.upper_limit - robot.lower_limit
    for j, joint in enumerate(draft.joints.values()):
        tables = [g.table for g in groups]
        parts = [
            (t.theta[:, j], t.q[:, j], t.tau[:, j], float(np.median(np.diff(t.time))))
            for t in tables
            if t.q is not None
        ]
        parts = [part for part in parts if np.isfinite(part[1]).all()]
        if joint.gear != 1.0 or not parts:
            continue
        span = max(float(np.ptp(q)) for _, q, _, _ in parts)
        if (
            "unit" not in joint.signals["q"]
            and 0.5 < width[j] < 20.0
            and span > TOO_FAR * width[j] > span * DEGREE
        ):
            joint.signals["q"]["unit"] = "deg"
            joint.say("q", f"in rad it would span {span:.3g}, and the joint can {width[j]:.3g}")
            changed = True
            continue
        changed |= find_gear(joint, parts)
    return changed


def find_gear(joint: DraftJoint, parts: Sequence[tuple[Array, Array, Array, float]]) -> bool:
    """A gear by which θ turns farther than q; `parts` has θ, q, τ (N,) and the step [s] of each group."""
    theta = np.concatenate([t - np.mean(t) for t, *_ in parts])
    q = np.concatenate([x - np.mean(x) for _, x, *_ in parts])
    both = float(theta @ q)
    if both == 0.0 or both**2 < SAME * float(theta @ theta) * float(q @ q):
        return False
    ratio, std = ratio_of(parts)
    if abs(abs(ratio) * DEGREE - 1.0) < NEAR:
        return False  # degrees: the robot's masses will say so
    if abs(ratio) > LARGEST_GEAR and "unit" not in joint.signals["theta"]:
        joint.signals["theta"]["unit"] = "deg"
        joint.say("theta", f"{abs(ratio):.4g} times q: degrees of the motor")
        ratio, std = ratio * DEGREE, std * DEGREE
    if not SMALLEST_GEAR < abs(ratio) < LARGEST_GEAR:
        return False
    whole = round(abs(ratio))
    certain = abs(abs(ratio) - whole) < max(3 * std, 1e-3 * whole) and std < WHOLE
    joint.gear = float(whole) if certain else float(f"{abs(ratio):.4g}")
    found = f"{ratio:.5g} ± {1.96 * std:.1g}"
    joint.say("gear", f"theta turns {found} times as far as q; the data sheet knows it exactly")
    for name in ("theta", "theta_ref"):
        if name in joint.signals:
            joint.signals[name]["side"] = "motor"
    return True


def ratio_of(parts: Sequence[tuple[Array, Array, Array, float]]) -> tuple[float, float]:
    """How many times as far as q θ turns, and its standard error.

    What the spring gives way and a delay are taken off: θ = ratio·q + c₁τ + c₂θ̇ + c₃θ̈.
    """
    rows, targets, seconds = [], [], 0.0
    for theta, q, tau, step in parts:
        speed = np.gradient(low_pass(theta, step), step)
        columns = [low_pass(q, step), low_pass(tau, step), speed, np.gradient(speed, step)]
        edge = min(len(theta) // 4, int(0.25 / step) + 1)
        rows.append(np.stack([x - np.mean(x) for x in columns], axis=1)[edge:-edge])
        targets.append((low_pass(theta, step) - np.mean(theta))[edge:-edge])
        seconds += step * len(targets[-1])
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(matrix / scale, rcond=1e-9)
    solution = inverse @ target
    residual = matrix / scale @ solution - target
    samples = max(8.0, 2 * BAND * seconds)  # that are independent after the filter
    variance = float(residual @ residual) / samples * float(inverse[0] @ inverse[0])
    return float(solution[0] / scale[0]), float(np.sqrt(variance * len(target))) / float(scale[0])
