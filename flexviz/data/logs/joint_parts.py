"""One joint's columns beside each other: q and the reference are nearly θ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.data.measurements import GroupTable


@dataclass(frozen=True, eq=False)
class JointPart:
    """One joint's columns of one group, means subtracted, all (N,)."""

    theta: Array  # θ (or what it stands beside), the column compared with it, τ
    other: Array
    tau: Array
    offset: float  # mean of θ minus mean of the column [rad]
    span: float  # of the column [rad]
    step: float  # [s]


def joint_parts(tables: Sequence[GroupTable], j: int, name: str, beside: str = "theta") -> list[JointPart]:
    """The column `beside`, the optional one `name` and τ of joint j, where a group has it."""
    parts = []
    for table in tables:
        columns = getattr(table, name)
        if columns is None or not np.isfinite(columns[:, j]).all():
            continue
        theta, other, tau = getattr(table, beside)[:, j], columns[:, j], table.tau[:, j]
        offset, span = float(np.mean(theta) - np.mean(other)), float(np.ptp(other))
        theta, other, tau = (np.asarray(x - np.mean(x), float) for x in (theta, other, tau))
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
