"""Compare columns of one joint: q and the reference are nearly θ, and the spring yields to the torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from flexviz.base.statistics import NORMAL_95
from flexviz.data.importing.column_names import ANGLE
from flexviz.data.importing.delays import fit_filtered, low_pass
from flexviz.data.importing.draft import Draft, DraftJoint
from flexviz.data.importing.mapping import Fix, Issue, Mapping
from flexviz.data.importing.thresholds import LIMITS
from flexviz.data.measurements import Array, GroupTable
from flexviz.robot.robot import Robot

DEGREE = ANGLE["deg"]  # [rad]
GEARS = 5.0, 500.0  # smallest and largest ratio taken for a gear
# in which signals are recorded in practice
USUAL_UNITS = (("rad", "deg", "rev"), ("m", "mm"), ("Nm", "mNm", "Ncm"), ("N", "kN"))


@dataclass(frozen=True, eq=False)
class JointPart:
    """One joint's columns of one group, means subtracted, all (N,)."""

    theta: Array  # θ, the column compared with it, τ
    other: Array
    tau: Array
    offset: float  # mean of θ minus mean of the column [rad]
    span: float  # of the column [rad]
    step: float  # [s]


def joint_parts(tables: Sequence[GroupTable], j: int, name: str) -> list[JointPart]:
    """θ, the optional column `name` and τ of joint j, of every group that has it."""
    parts = []
    for table in tables:
        columns = getattr(table, name)
        if columns is None or not np.isfinite(columns[:, j]).all():
            continue
        theta, other, tau = table.theta[:, j], columns[:, j], table.tau[:, j]
        offset, span = float(np.mean(theta) - np.mean(other)), float(np.ptp(other))
        theta, other, tau = (x - np.mean(x) for x in (theta, other, tau))
        parts.append(JointPart(theta, other, tau, offset, span, float(np.median(np.diff(table.time)))))
    return parts


def followed(parts: Sequence[JointPart]) -> tuple[float, float | None]:
    """Squared correlation of a column with θ and its slope against θ; 0 and None where one stands still."""
    power = sum(float(part.theta @ part.theta) for part in parts)
    other_power = sum(float(part.other @ part.other) for part in parts)
    both = sum(float(part.theta @ part.other) for part in parts)
    if min(power, other_power) == 0.0:
        return 0.0, None
    return both**2 / (power * other_power), both / power


@dataclass(frozen=True)
class ColumnChange:
    """Fixes of one joint's signal, and the factor by which they change its values."""

    fixes: tuple[Fix, ...] = ()
    factor: float = 1.0

    def __str__(self) -> str:
        values = ((f.key, f'"{f.value}"' if isinstance(f.value, str) else f.value) for f in self.fixes)
        return ", ".join(f"{key} = {value}" for key, value in values)


def change_of(mapping: Mapping, joint: str, name: str, keys: dict[str, Any]) -> ColumnChange:
    """Other values for keys of a signal."""
    entry = mapping.joints[joint]
    now = getattr(entry, name)
    factor = entry.scale(now.model_copy(update=keys)) / entry.scale(now)
    return ColumnChange(tuple(Fix(joint, name, key, value) for key, value in keys.items()), factor)


def conversions(mapping: Mapping, joint: str, name: str, further: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Another usual or further unit, or the other side of the gear, where that changes a signal's values."""
    signal = getattr(mapping.joints[joint], name)
    default = USUAL_UNITS[2 if name in ("tau", "tau_joint") else 0]
    units = next((units for units in USUAL_UNITS if signal.unit in units), default)
    other_side = "joint" if signal.side == "motor" else "motor"
    keys = [*({"unit": unit} for unit in (*units, *further)), {"side": other_side}]
    factors = (change_of(mapping, joint, name, one).factor for one in keys)
    return [one for one, factor in zip(keys, factors, strict=True) if abs(factor - 1.0) > 1e-5]


def theta_changes(mapping: Mapping, joint: str) -> list[ColumnChange]:
    """θ in other units or on the other side of the gear."""
    return [change_of(mapping, joint, "theta", one) for one in conversions(mapping, joint, "theta")]


def check_optional_columns(mapping: Mapping, tables: Sequence[GroupTable]) -> list[Issue]:
    """Issues of the columns that are only for comparison, or of θ compared with them."""
    found: list[Issue] = []
    for name in ("q", "theta_ref"):
        for j, joint in enumerate(mapping.names):
            parts = joint_parts(tables, j, name)
            found += check_against_theta(mapping, joint, name, parts) if parts else []
    return found


def check_against_theta(mapping: Mapping, joint: str, name: str, parts: list[JointPart]) -> list[Issue]:
    """Compare one column of one joint with θ and τ."""
    share, slope = followed(parts)
    if slope is None:
        return []
    if share < LIMITS.follows:
        message = f"it follows theta by {100 * share:.0f} % only: the same joint?"
        return [Issue("unexplained", "odd", (joint,), name, message)]
    if not 1 / LIMITS.near < slope < LIMITS.near:
        return [wrong_scale(mapping, joint, name, slope)]
    found: list[Issue] = []
    zero = float(np.mean([part.offset for part in parts]))
    if name == "q" and abs(zero) > LIMITS.zero:
        offset = round(getattr(mapping.joints[joint], name).offset + zero, 6)
        message = (
            f"its mean is {-zero:.3g} rad from that of theta, too far for a spring: another zero position?"
        )
        found.append(Issue("zero", "odd", (joint,), name, message, (Fix(joint, name, "offset", offset),)))
    deflection = np.concatenate([part.theta - part.other for part in parts])
    tau = np.concatenate([part.tau for part in parts])
    size = float(np.sqrt((deflection @ deflection) * (tau @ tau)))
    if name == "q" and size > 0.0 and float(deflection @ tau) < LIMITS.swapped * size:
        message = (
            "theta − q falls where tau rises, a spring does the opposite: are theta and q swapped, or is the "
            "sign of tau wrong?"
        )
        found.append(Issue("swapped", "odd", (joint,), name, message))
    return found


def wrong_scale(mapping: Mapping, joint: str, name: str, slope: float) -> Issue:
    """The issue of a column that follows θ by a factor other than 1."""
    signs = {}, {"sign": -getattr(mapping.joints[joint], name).sign}
    keys = {}, *conversions(mapping, joint, name)
    combined = [change_of(mapping, joint, name, one | sign) for sign, one in product(signs, keys)]
    correct = [x for x in combined if 1 / LIMITS.agrees < slope * x.factor < LIMITS.agrees]
    message = f"it is {slope:.4g} times theta"
    if not correct:
        gear = max(abs(slope), 1 / abs(slope))
        hint = f"a gear of {gear:.5g} on one of the two" if np.log(gear) > 1 else "another joint or unit"
        return Issue("unit", "wrong", (joint,), name, f"{message}: {hint}?")
    change = min(correct, key=lambda x: len(str(x)))
    kind = "sign" if change.fixes[0].key == "sign" else "unit"
    return Issue(kind, "wrong", (joint,), name, f"{message}: with {change} they agree", change.fixes)


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
