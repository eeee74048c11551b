"""What a model does not know of the torque while a gap is crossed."""

from __future__ import annotations

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Layout, OperatingPoint, pulses


def has_gaps(layout: Layout) -> bool:
    """Whether a joint of a model has a gap."""
    return layout.has_reversals and any(EFFECTS[e.effect].where == "joint" for e in layout.effects)


def unknown_variance(point: OperatingPoint, x: Array) -> Array:
    """Its variance at the parameters x, (P,), of a model with gaps: shape (N, n) [Nm²].

    It depends on noise and on details of the crossing, which nobody knows.
    """
    variance = np.zeros((point.signals.count, point.layout.n))
    for part in pulses(point, x, point.link_terms(x)):
        begin = point.signals.blocks[part.block].rows.start
        for group in part.groups:
            first = max(group.first, part.rows.start)
            squares = np.sum(group.columns[first - group.first :] ** 2, axis=2)
            variance[begin + first : begin + first + len(squares)] += squares
    return variance
