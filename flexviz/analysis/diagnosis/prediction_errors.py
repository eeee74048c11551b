"""Residuals of every group in Nm, for display, in one band that is flat at the frequencies of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import Fitted
from flexviz.analysis.estimation import BAND_HERTZ, ErrorBand, PredictionErrors
from flexviz.analysis.identification import by_free_motion
from flexviz.analysis.motion import Known, Phases, phases
from flexviz.base.iteration import Iteration
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import layout_of
from flexviz.robot.model import FlexibleModel

Array = NDArray[np.float64]

__all__ = ["BAND_HERTZ", "PredictionErrorBand", "PredictionErrors"]


class PredictionErrorBand(ErrorBand):
    """The band of the errors, where joints may be judged by their motion alone."""

    @cached_property
    def phases(self) -> Phases:
        """Whether a joint rests, starts or moves, shape (N, n)."""
        return phases(self.signals)

    def errors(self, fit: Fitted, first_phase: Phases | None = None) -> PredictionErrors:
        """Residuals of a model; `first_phase`, shape (n,): the first phase of each joint that counts."""
        return self.judged(fit, None if first_phase is None else self.phases >= first_phase)


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

    None where the group is too short for the band. Of joints that follow goals: how far these are ahead, and
    the errors of the free motion [rad], in no band.
    """
    if measurements.drive is not None:
        found: TorqueOverTime = by_free_motion("free_over_time")(measurements, group, [m for m, _ in models])
        return found
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

    An iteration with other parameters has the errors of the model. Joints that follow goals are judged by
    their free motion.
    """
    if measurements.drive is not None:
        judged: PredictionErrors = by_free_motion("free_errors")(measurements, model)
        return (judged,) * (1 + len(ends))
    layout, band = layout_of(measurements, effects), PredictionErrorBand(measurements)
    points, names = [layout.vector(model)], tuple(layout.labels())
    for one in ends:
        x = points[0].copy()
        if tuple(one.names) == names:
            x[:] = one.values
            x[layout.compliance] = 1.0 / x[layout.compliance]
        points.append(x)
    return tuple(band.errors(Known(layout, x)) for x in points)
