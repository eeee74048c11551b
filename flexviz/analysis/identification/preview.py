"""The residual of a given model with another observer: the derivatives are renewed, nothing is fitted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.analysis.estimation import residual_noise
from flexviz.base.arrays import Array
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.equation import Equation, OperatingPoint, build_signals, layout_of
from flexviz.model.observers import Observer
from flexviz.robot.model import FlexibleModel

FLOOR_SAMPLES = 100  # of the pose, for the noise floor


@dataclass(frozen=True, eq=False)
class ObservedResidual:
    """The residual of a model with one observer.

    Attributes:
        time: shape (N,) [s].
        residual: shape (N, n) [Nm].
        rms: shape (n,) [Nm].
        noise_floor: shape (n,), the rms that measurement noise alone would leave [Nm].
    """

    time: Array
    residual: Array
    rms: Array
    noise_floor: Array


class ResidualPreview:
    """Evaluates the residual of one model in one group with any observer.

    Args:
        measurements: the set.
        group: the group, or a part of it.
        model: its parameters are kept.
        effects: those of the model in addition to the set's own.
    """

    def __init__(
        self, measurements: MeasurementSet, group: Group, model: FlexibleModel, effects: Iterable[str] = ()
    ) -> None:
        self._measurements, self._group = measurements, group
        self._layout = layout_of(measurements, tuple(effects))
        self._x = self._layout.vector(model)
        self._fine: dict[object, Any] = {}  # wide-band signals, which depend on no observer
        self._point: OperatingPoint | None = None  # of the last evaluation
        self._noise = segments_noise(list(group.segments))

    def _equation(self, observer: Observer) -> Equation:
        signals = build_signals(self._measurements, (self._group,), observer, exact_step=True)
        kept = len(signals.blocks) == len(self._group.segments)
        shared = {key: value for key, value in self._fine.items() if kept and _is_fine(key)}
        self._fine = shared
        return Equation(self._measurements.robot, signals, self._layout, shared)

    def at(self, observer: Observer) -> ObservedResidual:
        """The residual with this observer; InputError if the group is too short for it."""
        equation = self._equation(observer)
        point = equation.at(self._x)
        if self._point is not None:
            point.context.take_motions(self._point.context)
        self._point = point
        residual = point.residual(self._x)
        rms, link = np.sqrt(np.mean(residual**2, axis=0)), point.link_terms(self._x)
        signals = equation.signals
        floor = residual_noise(signals, self._layout, self._x, link, self._noise, samples=FLOOR_SAMPLES)
        return ObservedResidual(signals.time, residual, rms, np.sqrt(floor))


def _is_fine(key: object) -> bool:
    return key == "noise" or (isinstance(key, tuple) and key[0] in ("bands", "fine"))
