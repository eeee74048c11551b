"""What a model does not know of the torque while a gap is crossed."""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array
from flexviz.effects import EFFECTS
from flexviz.equation import OperatingPoint, pulses


def unknown_variance(point: OperatingPoint, x: Array) -> Array | None:
    """Its variance at the parameters x, (P,): shape (N, n) [Nm²]; None for a model without gaps.

    It depends on noise and on details of the crossing, which nobody knows.
    """
    layout = point.layout
    if not (layout.has_reversals and any(EFFECTS[e.effect].where == "joint" for e in layout.effects)):
        return None
    variance = np.zeros((point.signals.count, layout.n))
    for part in pulses(point, x, point.link_terms(x)):
        begin = point.signals.blocks[part.block].rows.start
        for group in part.groups:
            first = max(group.first, part.rows.start)
            squares = np.sum(group.columns[first - group.first :] ** 2, axis=2)
            variance[begin + first : begin + first + len(squares)] += squares
    return variance
