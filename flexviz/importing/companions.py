"""Compare columns that belong together: q and the reference are nearly θ, the spring gives way to torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.importing.mapping import Angle, Mapping
from flexviz.importing.suspicion import Fix, Suspicion
from flexviz.importing.traces import size_of
from flexviz.importing.units import ANGLE
from flexviz.measurements import Array, GroupTable

FOLLOWS = 0.8  # squared correlation from which a column is taken for θ in another unit
NEAR = 1.25  # largest ratio of a right slope to 1
SAME = 1.06  # and of a slope that a unit or a known gear explains
ZERO = 0.1  # [rad] a larger mean difference is no deflection
SWAPPED = -0.7  # correlation of θ − q with τ; a spring makes it positive


def compare(mapping: Mapping, tables: Sequence[GroupTable]) -> list[Suspicion]:
    """What is wrong with the columns that are only for comparison, or with θ beside them."""
    found: list[Suspicion] = []
    for name in ("q", "theta_ref"):
        for j, joint in enumerate(mapping.names):
            parts = [
                (t.theta[:, j], getattr(t, name)[:, j], t.tau[:, j])
                for t in tables
                if getattr(t, name) is not None
            ]
            parts = [part for part in parts if np.isfinite(part[1]).all()]
            if parts:
                found += compare_joint(mapping, joint, name, parts)
    return found


def compare_joint(
    mapping: Mapping, joint: str, name: str, parts: list[tuple[Array, Array, Array]]
) -> list[Suspicion]:
    """One column of one joint; `parts` has (θ, column, τ) of each group, (N,) each."""
    theta, other, tau = (
        np.concatenate([x - np.mean(x) for x in column]) for column in zip(*parts, strict=True)
    )
    power = float(theta @ theta), float(other @ other)
    if min(power) == 0.0:
        return []
    slope = float(theta @ other) / power[0]
    if float(theta @ other) ** 2 < FOLLOWS * power[0] * power[1]:
        share = 100 * float(theta @ other) ** 2 / (power[0] * power[1])
        message = f"it follows theta by {share:.0f} % only: the same joint?"
        return [Suspicion("unexplained", "odd", (joint,), name, message)]
    if not 1 / NEAR < slope < NEAR:
        return [other_unit(mapping, joint, name, slope)]
    found = []
    zero = float(np.mean([np.mean(a) - np.mean(b) for a, b, _ in parts]))
    signal = getattr(mapping.joints[joint], name)
    if name == "q" and abs(zero) > ZERO:
        offset = round(signal.offset + zero, 6)
        message = (
            f"it is {-zero:.3g} rad from theta on average, more than a spring gives: another zero position?"
        )
        found.append(Suspicion("zero", "odd", (joint,), name, message, (Fix(joint, name, "offset", offset),)))
    deflection = theta - other
    size = float(np.sqrt((deflection @ deflection) * (tau @ tau)))
    if name == "q" and size > 0.0 and float(deflection @ tau) < SWAPPED * size:
        message = (
            "theta − q falls where tau rises, a spring does the opposite: are theta and q swapped, or is the "
            "sign of tau wrong?"
        )
        found.append(Suspicion("swapped", "odd", (joint,), name, message))
    return found


def other_unit(mapping: Mapping, joint: str, name: str, slope: float) -> Suspicion:
    """A column that follows θ by a factor other than 1."""
    entry = mapping.joints[joint]
    signal: Angle = getattr(entry, name)
    size = size_of(signal.unit, ANGLE)
    ways: dict[str, tuple[float, tuple[Fix, ...]]] = {}
    for sign in (1, -1):
        turn = (Fix(joint, name, "sign", -signal.sign),) if sign < 0 else ()
        said = f"sign = {-signal.sign}" if sign < 0 else ""
        ways[said] = (sign, turn)
        for unit in ("rad", "deg", "rev"):
            both = ", ".join(part for part in (f'unit = "{unit}"', said) if part)
            ways[both] = (sign * ANGLE[unit] / size, (Fix(joint, name, "unit", unit), *turn))
        if entry.gear != 1.0:
            side = "joint" if signal.side == "motor" else "motor"
            factor = entry.gear if signal.side == "motor" else 1.0 / entry.gear
            both = ", ".join(part for part in (f'side = "{side}"', said) if part)
            ways[both] = (sign * factor, (Fix(joint, name, "side", side), *turn))
    right = {said: fixes for said, (factor, fixes) in ways.items() if 1 / SAME < slope * factor < SAME}
    message = f"it is {slope:.4g} times theta"
    if not right:
        gear = (
            f"a gear of {max(abs(slope), 1 / abs(slope)):.5g} on one of the two"
            if abs(np.log(abs(slope))) > 1
            else ""
        )
        hint = gear or "another joint or unit"
        return Suspicion("unit", "wrong", (joint,), name, f"{message}: {hint}?")
    said = min(right, key=len)
    kind = "sign" if said.startswith("sign") else "unit"
    return Suspicion(kind, "wrong", (joint,), name, f"{message}: with {said} they agree", right[said])
