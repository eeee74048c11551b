"""Which other unit or side of the gear θ can have: what the joint's range allows and what q says."""

from __future__ import annotations

import numpy as np

from flexviz.importing.explaining import Judge
from flexviz.importing.mapping import Mapping
from flexviz.importing.suspicion import Fix, Suspicion
from flexviz.importing.traces import size_of
from flexviz.importing.units import ANGLE

SMALL = 0.2  # [rad] a larger motion is in no smaller unit than it is said to be
ROOM = 1.3  # times the range and speed of the joint that may be used
SAME = 1.06  # largest ratio of θ to q when they agree

Ways = dict[str, tuple[float, Fix]]  # how it is said -> (factor, fix)


def ways_of_theta(mapping: Mapping, joint: str) -> Ways:
    """All other units, and the other side of the gear."""
    entry = mapping.joints[joint]
    size = size_of(entry.theta.unit, ANGLE)
    ways = {
        f'unit = "{unit}"': (ANGLE[unit] / size, Fix(joint, "theta", "unit", unit))
        for unit in ("rad", "deg", "rev")
        if not np.isclose(ANGLE[unit], size)
    }
    if entry.gear != 1.0:
        other = "joint" if entry.theta.side == "motor" else "motor"
        factor = entry.gear if entry.theta.side == "motor" else 1.0 / entry.gear
        ways[f'side = "{other}"'] = (factor, Fix(joint, "theta", "side", other))
    return ways


def possible_ways(mapping: Mapping, judged: Judge, j: int, already: float) -> Ways:
    """Those that bring a motion which is too large for joint j into its range, or a very small one up.

    `already` is the factor that is assumed so far. Where q is recorded it decides, not the torques.
    """
    if judged.q_ratio[j] and in_range(judged, j, 1.0 / judged.q_ratio[j]):
        return {}
    span, speed = judged.span[j] * abs(already), judged.speed[j] * abs(already)
    too_large = span > judged.width[j] or speed > judged.fastest[j]
    return {
        said: way
        for said, way in ways_of_theta(mapping, mapping.names[j]).items()
        if (too_large if way[0] < 1.0 else span < SMALL) and in_range(judged, j, already * way[0])
    }


def in_range(judged: Judge, j: int, factor: float) -> bool:
    """Whether θ times `factor` is a motion that joint j can make."""
    return (
        judged.span[j] * abs(factor) < ROOM * judged.width[j]
        and judged.speed[j] * abs(factor) < ROOM * judged.fastest[j]
    )


def against_q(mapping: Mapping, judged: Judge) -> tuple[list[Suspicion], dict[int, float]]:
    """θ that q contradicts, and by which factor it must be multiplied: joint's index -> factor.

    Only where q is a motion that the joint can make and θ is not: else q may be what is wrong.
    """
    found: list[Suspicion] = []
    factors: dict[int, float] = {}
    for j, joint in enumerate(mapping.names):
        ratio = abs(judged.q_ratio[j])
        if (
            not ratio
            or 1 / SAME < ratio < SAME
            or in_range(judged, j, 1.0)
            or not in_range(judged, j, 1 / ratio)
        ):
            continue
        message = f"it turns {ratio:.5g} times as far as q"
        ways = ways_of_theta(mapping, joint)
        right = [said for said, (factor, _) in ways.items() if 1 / SAME < ratio * factor < SAME]
        if right:
            factors[j], fix = ways[right[0]]
            found.append(
                Suspicion(
                    "unit", "wrong", (joint,), "theta", f"{message}: with {right[0]} they agree", (fix,)
                )
            )
        else:
            factors[j] = 1 / ratio
            message += f': is that the motor\'s angle before a gear (gear = {ratio:.4g}, side = "motor")?'
            found.append(Suspicion("unit", "wrong", (joint,), "theta", message))
    return found, factors
