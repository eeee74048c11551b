"""Products of signals formed before they are filtered.

The equation is filtered, and the filter of a product, F[M(q) q̈], is not the product of what is filtered,
M(Fq) Fq̈: they differ by −iF′(ω) of what M changes by, which is largest in the filter's transition, where a
link that breaks loose, or a play that is crossed, lets a light link ring. There, the filter leaves so little
noise that a difference of a thousandth of the torque is many times as large.

Here the equation is evaluated from signals of twice the band, at closer samples, and then filtered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.equation.fine_signals import fine_stride
from flexviz.model.equation.residual import Equation, OperatingPoint
from flexviz.model.equation.signals import Block, Signals, build_signals
from flexviz.model.observers import Observer


class FilteredProducts:
    """The residual at the samples of given signals, from signals of twice the band.

    Args:
        measurements, groups: the data.
        signals: in whose band and at whose samples the residual is wanted.
        observer: of twice the band.
        edge: seconds dropped at the ends of a stretch: fewer than those of `signals`.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        groups: Sequence[Group],
        signals: Signals,
        observer: Observer,
        edge: float,
    ) -> None:
        strides = {id(block.segment): _closer(block) for block in signals.blocks}
        finer = build_signals(
            measurements,
            groups,
            observer,
            drop=(edge, edge),
            strides=lambda segment: strides.get(id(segment)),
        )
        self._signals, self._finer = signals, replace(finer, sharp=True)
        self._closer = {id(block.segment): block for block in finer.blocks}  # may be more than the signals'
        self._robot, self._shared = measurements.robot, dict[object, Any]()

    def residual(self, point: OperatingPoint, x: Array) -> Array:
        """Residual at x (P,), shape (N, n) [Nm]; `point`: operating point at the given signals."""
        equation = Equation(self._robot, self._finer, point.layout, self._shared)
        q = equation.without_effects(point.x)
        context = point.context.at_samples_of(self._finer, self._shared, q)
        seen = OperatingPoint(equation, point.x, context, {})
        if equation.has_state:
            s, q = seen.motor_side(point.x)
            seen = seen.seeing(point.x, q, s[0])
        left = seen.residual(x)
        out = np.empty((self._signals.count, left.shape[1]))
        for block in self._signals.blocks:
            closer = self._closer[id(block.segment)]
            step = block.segment.step * closer.stride
            ratio = block.stride // closer.stride
            late = float(self._signals.time[block.rows.start] - self._finer.time[closer.rows.start])
            skipped, first = divmod(round(late / step), ratio)
            rows = slice(closer.rows.start + first, closer.rows.stop)
            found = self._signals.observer.derivatives(left[rows], step, 1, stride=ratio)[0]
            out[block.rows] = found[skipped : skipped + block.rows.stop - block.rows.start]
        return out


def _closer(block: Block) -> int:
    """Raw samples per closer sample: at most half as many, on the grid of the effects."""
    fine = fine_stride(block)
    steps = range(block.stride // 2, 0, -1)
    return next((d for d in steps if block.stride % d == 0 and d % fine == 0), block.stride)
