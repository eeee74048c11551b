"""Residuals of every group in Nm, for display, in one band that is flat at the frequencies of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fitted
from flexviz.equation import Equation, Layout, build_signals, layout_of
from flexviz.estimation import residual_noise
from flexviz.iteration import Iteration
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.motion import LONGEST_EDGE, Phases, phases
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase
from flexviz.records import GroupError

Array = NDArray[np.float64]

BAND_HERTZ = 5.0


@dataclass(frozen=True, eq=False)
class Known:
    """A model with its parameters, shape (P,)."""

    layout: Layout
    x: Array


@dataclass(frozen=True, eq=False)
class PredictionErrors:
    """Residuals of one model.

    Attributes:
        rms: per joint, over the fit groups [Nm]; without standstill where that is judged apart.
        rms_validation: the same over the validation groups; None without any.
        groups: of every group.
        noise_floor: per joint, rms due to measurement noise alone [Nm].
        residual: shape (N, n) [Nm].
    """

    rms: tuple[float, ...]
    rms_validation: tuple[float, ...] | None
    groups: tuple[GroupError, ...]
    noise_floor: tuple[float, ...]
    residual: Array

    @property
    def stated(self) -> tuple[float, ...]:
        """Of the validation groups, if there are any, else of the fit groups."""
        return self.rms_validation or self.rms

    @property
    def stated_name(self) -> str:
        """Which error `stated` is: "validation" or "fit"."""
        return "validation" if self.rms_validation else "fit"


class PredictionErrorBand:
    """Signals of a set in the display band; `rows`: samples of each group."""

    def __init__(self, measurements: MeasurementSet) -> None:
        self.measurements = measurements
        observer = FlatZeroPhase(2 * np.pi * BAND_HERTZ)
        made = build_signals(measurements, measurements.groups, observer, longest_edge=LONGEST_EDGE)
        self.signals = replace(made, sharp=True)
        self._shared: dict[object, Any] = {}
        self._noise = segments_noise([b.segment for b in self.signals.blocks])
        of_group = self.signals.group
        self.rows = {g.name: np.flatnonzero(of_group == k) for k, g in enumerate(self.signals.groups)}

    @cached_property
    def phases(self) -> Phases:
        """Whether a joint rests, starts or moves, shape (N, n)."""
        return phases(self.signals)

    def errors(self, fit: Fitted, first_phase: Phases | None = None) -> PredictionErrors:
        """Residuals of a model; `first_phase`, shape (n,): the first phase of each joint that counts."""
        point = Equation(self.measurements.robot, self.signals, fit.layout, self._shared).at(fit.x)
        residual = point.residual(fit.x)
        used = self.signals.known
        if first_phase is not None:
            used = used & (self.phases >= first_phase)

        def rms(names: Sequence[str]) -> tuple[float, ...]:
            rows = np.concatenate([np.arange(0), *(self.rows[name] for name in names)])
            squares = np.sum(residual[rows] ** 2, axis=0, where=used[rows])
            return tuple(map(float, np.sqrt(squares / np.maximum(used[rows].sum(axis=0), 1))))

        seen = [g for g in self.signals.groups if len(self.rows[g.name])]
        fitted, held_out = ([g.name for g in seen if g.validation == held] for held in (False, True))
        floor = np.sqrt(residual_noise(self.signals, fit.layout, fit.x, point.link_terms(fit.x), self._noise))
        return PredictionErrors(
            rms(fitted),
            rms(held_out) if held_out else None,
            tuple(GroupError(g.name, rms([g.name]), g.validation) for g in seen),
            tuple(map(float, floor)),
            residual,
        )


@dataclass(frozen=True, eq=False)
class TorqueOverTime:
    """The longest stretch of a group below `BAND_HERTZ`.

    Attributes:
        time: shape (N,) [s], within the group.
        torque: measured, shape (N, n) [Nm].
        residuals: of every model, shape (N, n) [Nm] each.
    """

    time: Array
    torque: Array
    residuals: tuple[Array, ...]


def torque_over_time(
    measurements: MeasurementSet, group: str, models: Sequence[tuple[FlexibleModel, Sequence[str]]]
) -> TorqueOverTime | None:
    """Torque of a group and what models leave of it; each with its effects besides those of the set.

    None where the group is too short for the band.
    """
    band = PredictionErrorBand(measurements)
    signals = band.signals
    stretches = [b.rows for b in signals.blocks if signals.groups[b.group].name == group]
    if not stretches:
        return None
    rows = max(stretches, key=lambda one: one.stop - one.start)
    layouts = [(layout_of(measurements, effects), model) for model, effects in models]
    fits = [Known(layout, layout.vector(model)) for layout, model in layouts]
    return TorqueOverTime(
        signals.time[rows], signals.tau[0, rows], tuple(band.errors(fit).residual[rows] for fit in fits)
    )


def prediction_errors(
    measurements: MeasurementSet, model: FlexibleModel, effects: Sequence[str] = ()
) -> PredictionErrors:
    """Errors of a model with the set's effects and additional `effects`, as the diagnosis states them."""
    return errors_along(measurements, model, effects, ())[0]


def errors_along(
    measurements: MeasurementSet, model: FlexibleModel, effects: Sequence[str], ends: Sequence[Iteration]
) -> tuple[PredictionErrors, ...]:
    """Errors of a model, then those at the values of the iterations `ends` that led to it.

    An iteration with other parameters has the errors of the model.
    """
    layout, band = layout_of(measurements, effects), PredictionErrorBand(measurements)
    points, names = [layout.vector(model)], tuple(layout.labels())
    for one in ends:
        x = points[0].copy()
        if tuple(one.names) == names:
            x[:] = one.values
            x[layout.compliance] = 1.0 / x[layout.compliance]
        points.append(x)
    return tuple(band.errors(Known(layout, x)) for x in points)
