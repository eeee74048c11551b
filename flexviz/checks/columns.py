"""Columns for comparison only: q and the reference are nearly θ, and the spring yields to the torque."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from flexviz.checks.issues import Issue
from flexviz.checks.thresholds import LIMITS
from flexviz.data.logs import Fix, JointPart, Mapping, change_of, conversions, followed, joint_parts
from flexviz.data.measurements import GroupTable


def check_optional_columns(mapping: Mapping, tables: Sequence[GroupTable]) -> list[Issue]:
    """Issues of the columns that are only for comparison, or of θ compared with them."""
    found: list[Issue] = []
    for name in ("q", "theta_ref"):
        for j, joint in enumerate(mapping.names):
            parts = joint_parts(tables, j, name)
            found += check_against_theta(mapping, joint, name, parts) if parts else []
    for j, joint in enumerate(mapping.names):
        share, slope = followed(joint_parts(tables, j, "tau_joint", beside=compared_with("tau_joint")))
        # motor inertia and friction are only in τ
        if slope is None or share < LIMITS.follows:
            continue
        if not 1 / LIMITS.far_beyond < abs(slope) < LIMITS.far_beyond:
            found.append(wrong_scale(mapping, joint, "tau_joint", slope))
    return found


def compared_with(name: str) -> str:
    """The measured signal that a column for comparison nearly is."""
    return "tau" if name == "tau_joint" else "theta"


def check_against_theta(mapping: Mapping, joint: str, name: str, parts: list[JointPart]) -> list[Issue]:
    """Compare one column of one joint with θ and τ."""
    share, slope = followed(parts)
    if slope is None:
        return []
    if share < LIMITS.follows:
        return [Issue("unexplained", "odd", (joint,), name, {"share": share})]
    if not 1 / LIMITS.near < slope < LIMITS.near:
        return [wrong_scale(mapping, joint, name, slope)]
    found: list[Issue] = []
    zero = float(np.mean([part.offset for part in parts]))
    if name == "q" and abs(zero) > LIMITS.zero:
        offset = round(getattr(mapping.joints[joint], name).offset + zero, 6)
        fix = Fix(joint, name, "offset", offset)
        found.append(Issue("zero", "odd", (joint,), name, {"difference": -zero}, (fix,)))
    deflection = np.concatenate([part.theta - part.other for part in parts])
    tau = np.concatenate([part.tau for part in parts])
    size = float(np.sqrt((deflection @ deflection) * (tau @ tau)))
    if name == "q" and size > 0.0 and float(deflection @ tau) < LIMITS.swapped * size:
        found.append(Issue("swapped", "odd", (joint,), name))
    return found


def wrong_scale(mapping: Mapping, joint: str, name: str, slope: float) -> Issue:
    """The issue of a column that follows θ, or τ, by a factor other than 1."""
    signs = {}, {"sign": -getattr(mapping.joints[joint], name).sign}
    keys = {}, *conversions(mapping, joint, name)
    combined = [change_of(mapping, joint, name, one | sign) for sign, one in product(signs, keys)]
    correct = [x for x in combined if 1 / LIMITS.agrees < slope * x.factor < LIMITS.agrees]
    values = {"times_theta": slope, "times": slope, "measured": compared_with(name)}
    if not correct:
        return Issue("unit", "wrong", (joint,), name, values)
    change = min(correct, key=lambda x: len(str(x)))
    kind = "sign" if change.fixes[0].key == "sign" else "unit"
    return Issue(kind, "wrong", (joint,), name, values, change.fixes)
