"""The residual of a given model with another observer: the derivatives are renewed, nothing is fitted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Equation, OperatingPoint, build_signals, layout_of
from flexviz.estimation import noise_density, noise_paths
from flexviz.measurements import Group, MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.noise import segments_noise
from flexviz.observers import ButterworthZeroPhase, Observer

Array = NDArray[np.float64]

SEEN = 2 * np.pi * 8.0  # [rad/s] band of the motion along which noise reaches the residual
FLOOR_SAMPLES = 100  # of the pose, for the noise floor
FLOOR_FREQUENCIES = 300
LOWEST_FREQUENCY = 0.02  # of them, relative to the bandwidth


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
        effects: those of the model beside the set's own.
    """

    def __init__(
        self, measurements: MeasurementSet, group: Group, model: FlexibleModel, effects: Iterable[str] = ()
    ) -> None:
        self._measurements, self._group = measurements, group
        self._layout = layout_of(measurements, tuple(effects))
        self._x = self._layout.vector(model)
        self._fine: dict[object, Any] = {}  # wide-band signals, which depend on no observer
        self._point: OperatingPoint | None = None  # of the last evaluation
        equation = self._equation(ButterworthZeroPhase(SEEN))
        link = equation.at(self._x).link_terms(self._x)
        every = slice(None, None, max(1, equation.signals.count // FLOOR_SAMPLES))
        paths = noise_paths(self._layout, self._x, link)
        self._paths = [path.rows(every) for path in paths]
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
        rms = np.sqrt(np.mean(residual**2, axis=0))
        return ObservedResidual(equation.signals.time, residual, rms, self.noise_floor(observer))

    def noise_floor(self, observer: Observer) -> Array:
        """The rms residual due to measurement noise alone, shape (n,) [Nm]."""
        step = self._group.segments[0].step
        power = np.zeros(self._layout.n)
        for path, one in (part for whole in self._paths for part in whole.by_bandwidth(observer)):
            first = LOWEST_FREQUENCY * one.bandwidth_of(1)[0] / (2 * np.pi)
            hertz = np.r_[0.0, np.geomspace(first, 0.5 / step, FLOOR_FREQUENCIES)]
            density = noise_density([path], self._noise, one.transfer, step, hertz)
            power += np.trapezoid(density, hertz, axis=0)
        return np.sqrt(power)


def _is_fine(key: object) -> bool:
    return key == "noise" or (isinstance(key, tuple) and key[0] in ("bands", "fine"))
