"""Residuals of every group in Nm, for display, in one band that is flat at the frequencies of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fitted
from flexviz.diagnosis.motion_samples import Phases, phases
from flexviz.equation import Equation, Layout, OperatingPoint, build_signals, layout_of
from flexviz.estimation import residual_noise
from flexviz.measurements import Group, MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase
from flexviz.progress import Iteration

Array = NDArray[np.float64]

BAND_HERTZ = 5.0
LONGEST_EDGE = 0.15  # share of the shortest stretch that is dropped at each of its ends at most


@dataclass(frozen=True, eq=False)
class PredictionErrors:
    """Residuals of one model.

    Attributes:
        rms: per joint, over the fit groups [Nm]; without standstill where that is judged apart.
        rms_validation: per joint, over the validation groups [Nm]; None without any.
        groups: (name, rms per joint [Nm], whether held out) of every group.
        noise_floor: per joint, rms due to measurement noise alone [Nm].
        residual: shape (N, n) [Nm].
    """

    rms: tuple[float, ...]
    rms_validation: tuple[float, ...] | None
    groups: tuple[tuple[str, tuple[float, ...], bool], ...]
    noise_floor: tuple[float, ...]
    residual: Array


class PredictionErrorBand:
    """Signals in the display band.

    Args:
        measurements: the set.
        groups: of it; default: all.

    Attributes:
        stated: which error is stated: that of the validation groups, if there are any.
    """

    def __init__(self, measurements: MeasurementSet, groups: Sequence[Group] | None = None) -> None:
        self.measurements = measurements
        observer = FlatZeroPhase(2 * np.pi * BAND_HERTZ)
        made = build_signals(measurements, groups or measurements.groups, observer, longest_edge=LONGEST_EDGE)
        self.signals = replace(made, sharp=True)
        self._shared: dict[object, Any] = {}
        self.rows = {
            group.name: np.concatenate(
                [np.arange(b.rows.start, b.rows.stop) for b in self.signals.blocks if b.group == k]
                or [np.arange(0)]
            )
            for k, group in enumerate(self.signals.groups)
        }
        held_out = any(g.validation and len(self.rows[g.name]) for g in self.signals.groups)
        self.stated = "validation" if held_out else "fit"

    @cached_property
    def noise(self) -> tuple[Array, Array]:
        """Of θ [rad] and τ [Nm], shape (n,) each."""
        return segments_noise([b.segment for b in self.signals.blocks])

    @cached_property
    def _only_stated(self) -> PredictionErrorBand:
        """The groups whose error is stated."""
        groups, held_out = self.signals.groups, self.stated == "validation"
        stated = [g for g in groups if g.validation == held_out and len(self.rows[g.name])]
        return self if len(stated) == len(groups) else PredictionErrorBand(self.measurements, stated)

    @cached_property
    def phases(self) -> Phases:
        """Whether a joint rests, starts or moves, shape (N, n)."""
        return phases(self.signals)

    def errors(self, fit: Fitted, first_phase: Phases | None = None) -> PredictionErrors:
        """Residuals of a model; `first_phase`, shape (n,): the first phase of each joint that counts."""
        point, residual, used = self._residual(fit, first_phase)
        held_out = {g.name: g.validation for g in self.signals.groups}
        groups = tuple(
            (name, _rms(residual[rows], used[rows]), held_out[name])
            for name, rows in self.rows.items()
            if len(rows)
        )
        floor = np.sqrt(residual_noise(self.signals, fit.layout, fit.x, point.link_terms(fit.x), self.noise))
        return PredictionErrors(*self._rms(residual, used), groups, tuple(map(float, floor)), residual)

    def stated_rms(self, fit: Fitted, first_phase: Phases | None = None) -> tuple[float, ...]:
        """The stated one of `errors`, per joint [Nm], without evaluating any other."""
        return _rms(*self._only_stated._residual(fit, first_phase)[1:])

    def _residual(
        self, fit: Fitted, first_phase: Phases | None
    ) -> tuple[OperatingPoint, Array, NDArray[np.bool_]]:
        """A model, its residual, and which of it counts."""
        point = Equation(self.measurements.robot, self.signals, fit.layout, self._shared).at(fit.x)
        residual = point.residual(fit.x)
        return (
            point,
            residual,
            np.ones(residual.shape, bool) if first_phase is None else self.phases >= first_phase,
        )

    def _rms(
        self, residual: Array, used: NDArray[np.bool_]
    ) -> tuple[tuple[float, ...], tuple[float, ...] | None]:
        """Per joint, over the fit and over the validation groups."""
        parts = [
            [self.rows[g.name] for g in self.signals.groups if g.validation == held_out]
            for held_out in (False, True)
        ]
        fitted, held_out = (np.concatenate((np.arange(0), *rows)) for rows in parts)
        errors = _rms(residual[fitted], used[fitted])
        return errors, _rms(residual[held_out], used[held_out]) if len(held_out) else None


@dataclass(frozen=True, eq=False)
class Known:
    """A model with its parameters, shape (P,)."""

    layout: Layout
    x: Array


def prediction_errors(
    measurements: MeasurementSet, model: FlexibleModel, effects: Sequence[str] = ()
) -> PredictionErrors:
    """Errors of a model with the set's effects and additional `effects`, as the diagnosis states them."""
    return errors_along(measurements, model, effects, ())[0]


def errors_along(
    measurements: MeasurementSet,
    model: FlexibleModel,
    effects: Sequence[str],
    iterations: Sequence[Iteration],
) -> tuple[PredictionErrors, ...]:
    """Errors of a model, then those at the values of the `iterations` that led to it.

    An iteration with other parameters has the errors of the model.
    """
    layout, band = layout_of(measurements, effects), PredictionErrorBand(measurements)
    points, names = [layout.vector(model)], tuple(layout.labels())
    for one in iterations:
        x = points[0].copy()
        if tuple(one.names) == names:
            x[:] = one.values
            x[layout.compliance] = 1.0 / x[layout.compliance]
        points.append(x)
    return tuple(band.errors(Known(layout, x)) for x in points)


def _rms(residual: Array, used: NDArray[np.bool_]) -> tuple[float, ...]:
    return tuple(map(float, np.sqrt(np.sum(residual**2 * used, axis=0) / np.maximum(used.sum(axis=0), 1))))
