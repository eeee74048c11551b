"""The error of a model as every page states it: in one band that is flat at the frequencies of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.analysis.estimation.prior import torque_scale
from flexviz.analysis.estimation.start import start_values
from flexviz.analysis.estimation.two_band import residual_noise
from flexviz.base.arrays import Array, Bools
from flexviz.content.records import GroupError
from flexviz.data.measurements import MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.equation import Equation, Layout, OperatingPoint, build_signals, layout_of
from flexviz.model.observers import FlatZeroPhase

BAND_HERTZ = 5.0
LONGEST_EDGE = 0.15  # share of the shortest stretch that is dropped at each of its ends at most

_NOISE: WeakKeyDictionary[MeasurementSet, tuple[float, ...]] = WeakKeyDictionary()


class FittedModelLike(Protocol):
    """A model with its parameters, shape (P,)."""

    @property
    def layout(self) -> Layout: ...
    @property
    def x(self) -> Array: ...


@dataclass(frozen=True, eq=False)
class PredictionErrors:
    """Residuals of one model, in units of the recorded torque.

    Attributes:
        rms: per joint, over the fit groups [Nm]; without standstill where that is judged apart.
        rms_validation: the same over the validation groups; None without any.
        groups: of every group.
        noise_floor: per joint, rms due to measurement noise alone [Nm]; the same for all models of a set.
        residual: shape (N, n) [Nm].
        spread: per joint, standard deviation of the recorded torque over all groups [Nm]; empty if unknown.
        units: of each joint's torque, "N" where it slides; empty if all are in Nm.
    """

    rms: tuple[float, ...]
    rms_validation: tuple[float, ...] | None
    groups: tuple[GroupError, ...]
    noise_floor: tuple[float, ...]
    residual: Array
    spread: tuple[float, ...] = ()
    units: tuple[str, ...] = ()

    @property
    def stated(self) -> tuple[float, ...]:
        """Of the validation groups, if there are any, else of the fit groups."""
        return self.rms_validation or self.rms

    @property
    def stated_name(self) -> str:
        """Which error `stated` is: "validation" or "fit"."""
        return "validation" if self.rms_validation else "fit"


class ErrorBand:
    """Signals of a set below `BAND_HERTZ`; `rows`: samples of each group.

    Raises:
        InputError: all records are too short for the band.
    """

    def __init__(self, measurements: MeasurementSet) -> None:
        self.measurements = measurements
        observer = FlatZeroPhase(2 * np.pi * BAND_HERTZ)
        made = build_signals(measurements, measurements.groups, observer, longest_edge=LONGEST_EDGE)
        self.signals = replace(made, sharp=True)
        self._shared: dict[object, Any] = {}
        of_group = self.signals.group
        self.rows = {g.name: np.flatnonzero(of_group == k) for k, g in enumerate(self.signals.groups)}

    @property
    def noise_floor(self) -> tuple[float, ...]:
        """Rms that the sensors' noise alone leaves, per joint [Nm]; the same for all models of the set."""
        if self.measurements not in _NOISE:
            with threadpool_limits(1, "blas"):  # the matrices are small: threads would wait for each other
                _NOISE[self.measurements] = self._noise()
        return _NOISE[self.measurements]

    def _noise(self) -> tuple[float, ...]:
        """Of the set's own model at its start values: what a fit finds does not change the recording."""
        measurements, layout = self.measurements, layout_of(self.measurements)
        signals = replace(self.signals, sharp=False)  # start values are rough
        equation = Equation(measurements.robot, signals, layout)
        x = start_values(measurements, equation).x
        noise = segments_noise([b.segment for b in signals.blocks])
        variance = residual_noise(signals, layout, x, equation.at(x).link_terms(x), noise)
        return tuple(map(float, np.sqrt(variance) / torque_scale(layout, x)))

    def at(self, fit: FittedModelLike) -> OperatingPoint:
        """The equation of a model in this band."""
        return Equation(self.measurements.robot, self.signals, fit.layout, self._shared).at(fit.x)

    def judged(
        self,
        fit: FittedModelLike,
        used: Bools | None = None,
        fitted: Sequence[str] | None = None,
        point: OperatingPoint | None = None,
    ) -> PredictionErrors:
        """Errors of a model.

        Args:
            fit: the model.
            used: shape (N, n), the samples that count; None: all.
            fitted: names of the groups that were fitted; None: all that are not held out.
            point: the equation at the model (`at`), if it is known already.
        """
        point = point or self.at(fit)
        residual = point.residual(fit.x) / torque_scale(fit.layout, fit.x)
        counts = self.signals.known if used is None else self.signals.known & used

        def rms(names: Sequence[str]) -> tuple[float, ...]:
            rows = np.concatenate([np.arange(0), *(self.rows[name] for name in names)])
            squares = np.sum(residual[rows] ** 2, axis=0, where=counts[rows])
            return tuple(map(float, np.sqrt(squares / np.maximum(counts[rows].sum(axis=0), 1))))

        seen = [g for g in self.signals.groups if len(self.rows[g.name])]
        chosen, held_out = ([g.name for g in seen if g.validation == held] for held in (False, True))
        if fitted is not None:
            chosen = [name for name in chosen if name in fitted]
        return PredictionErrors(
            rms(chosen),
            rms(held_out) if held_out else None,
            tuple(GroupError(g.name, rms([g.name]), g.validation) for g in seen),
            self.noise_floor,
            residual,
            self.measurements.torque_spread,
            self.measurements.torque_units,
        )
