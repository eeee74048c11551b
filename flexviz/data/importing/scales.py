"""Units of q and θ, and the gear between them, as the columns show them: for a draft."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.statistics import NORMAL_95
from flexviz.checks import LIMITS
from flexviz.data.importing.delays import fit_filtered, low_pass
from flexviz.data.importing.draft import Draft, DraftJoint
from flexviz.data.logs import ANGLE, GEARS, JointPart, followed, joint_parts
from flexviz.data.measurements import GroupTable
from flexviz.robot.robot import Robot

DEGREE = ANGLE["deg"]  # [rad]


def find_scales(draft: Draft, robot: Robot, tables: Sequence[GroupTable]) -> bool:
    """Find units of q and θ, and the gear between them, of every joint; whether anything was changed."""
    changed = False
    width, prismatic = robot.upper_limit - robot.lower_limit, robot.prismatic
    for j, joint in enumerate(draft.joints.values()):
        parts = joint_parts(tables, j, "q")
        if joint.gear != 1.0 or not parts:
            continue
        span = max(part.span for part in parts)
        in_degrees = span > LIMITS.beyond * width[j] > span * DEGREE and 0.5 < width[j] < 20.0
        in_degrees &= not prismatic[j]
        if "unit" not in joint.signals["q"] and in_degrees:
            joint.signals["q"]["unit"] = "deg"
            joint.comment("q", f"in rad it would span {span:.3g}; the joint's range is {width[j]:.3g}")
            changed = True
        else:
            changed |= find_gear(joint, parts)
    return changed


def find_gear(joint: DraftJoint, parts: Sequence[JointPart]) -> bool:
    """Find a gear by which θ turns farther than q; whether there is one."""
    if followed(parts)[0] < LIMITS.same_motion:
        return False
    ratio, std = gear_ratio(parts)
    if 1 / LIMITS.agrees < abs(ratio) * DEGREE < LIMITS.agrees:
        return False  # degrees: the robot's masses will tell
    if abs(ratio) > GEARS[1] and "unit" not in joint.signals["theta"]:
        joint.signals["theta"]["unit"] = "deg"
        joint.comment("theta", f"{abs(ratio):.4g} times q: degrees of the motor")
        ratio, std = ratio * DEGREE, std * DEGREE
    if not GEARS[0] < abs(ratio) < GEARS[1]:
        return False
    whole = round(abs(ratio))
    certain = abs(abs(ratio) - whole) < max(3 * std, 1e-3 * whole) and 3 * std < 1
    joint.gear = float(whole) if certain else float(f"{abs(ratio):.4g}")
    found = f"{ratio:.5g} ± {NORMAL_95 * std:.1g}"
    joint.comment("gear", f"theta turns {found} times as far as q; the data sheet has the exact value")
    for name in ("theta", "theta_ref"):
        if name in joint.signals:
            joint.signals[name]["side"] = "motor"
    return True


def gear_ratio(parts: Sequence[JointPart]) -> tuple[float, float]:
    """θ per q, and its standard error.

    The spring's deflection and a delay are subtracted: θ = ratio·q + c₁τ + c₂θ̇ + c₃θ̈.
    """
    rows, targets, seconds = [], [], 0.0
    for part in parts:
        theta = low_pass(part.theta, part.step)
        speed = np.gradient(theta, part.step)
        columns = [low_pass(part.other, part.step), low_pass(part.tau, part.step), speed]
        columns.append(np.gradient(speed, part.step))
        edge = min(len(theta) // 4, int(0.25 / part.step) + 1)
        rows.append(np.stack([x - np.mean(x) for x in columns], axis=1)[edge:-edge])
        targets.append((theta - np.mean(theta))[edge:-edge])
        seconds += part.step * len(targets[-1])
    target = np.concatenate(targets)
    fit = fit_filtered(np.concatenate(rows), target, seconds)
    # cautious by √N: the residual is the model's error, not noise
    return float(fit.slopes[0]), float(fit.std[0]) * np.sqrt(len(target))
