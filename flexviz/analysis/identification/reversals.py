"""The samples away from reversals, where a model's friction torque is known."""

from __future__ import annotations

import numpy as np

from flexviz.analysis.identification.thresholds import IDENTIFICATION
from flexviz.base.arrays import Array, Bools, Indices
from flexviz.model.equation import OperatingPoint, pulses


def undisturbed(point: OperatingPoint, x: Array, rows: Indices, floor: Array) -> Bools | None:
    """Samples that no reversal and no crossing of a gap disturbs; None if nothing is unknown there.

    Around a reversal the torque of friction or backlash is unknown. A sample counts if the standard deviation
    of that torque, after the observer, is below the joint's noise floor.

    Args:
        point: operating point of the effects at x.
        x: shape (P,).
        rows: shape (M,), the samples that are asked for.
        floor: shape (n,), rms due to measurement noise alone [Nm].

    Returns:
        shape (M, n), for each joint; all samples where too few are undisturbed.
    """
    found = pulses(point, x, point.link_terms(x))
    if not found:
        return None
    signals = point.signals
    unknown = np.zeros((signals.count, len(floor)))  # variance [Nm²]
    for part in found:
        begin = signals.blocks[part.block].rows.start
        for group in part.groups:
            first = max(group.first, part.rows.start)
            variance = np.sum(group.columns[first - group.first :] ** 2, axis=2)
            unknown[begin + first : begin + first + len(variance)] += variance
    known = unknown[rows] < floor**2
    return known | (np.mean(known, axis=0) < IDENTIFICATION.undisturbed_share)
