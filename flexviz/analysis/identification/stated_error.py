"""The error of a fit as it is reported: in the band of all errors, so that fits with any observer compare."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.analysis.estimation import ErrorBand, torque_scale
from flexviz.analysis.identification.reversals import undisturbed
from flexviz.analysis.motion import Known, Phases, phases
from flexviz.base.arrays import Array, Bools
from flexviz.content.records import ResidualSummary
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Layout


def stated_residual(
    measurements: MeasurementSet,
    layout: Layout,
    x: Array,
    fitted: Sequence[str],
    first_phase: Phases | None = None,
) -> ResidualSummary:
    """Errors of a model with parameters x, shape (P,), that was fitted on the groups named.

    `first_phase`, shape (n,): the first phase of each joint's motion that counts.

    Raises:
        InputError: all records are too short for the band.
    """
    band, model = ErrorBand(measurements), Known(layout, x)
    point = band.at(model)
    used = None if first_phase is None else phases(band.signals) >= first_phase
    errors = band.judged(model, used, fitted=fitted, point=point)
    rows = np.sort(np.concatenate([np.arange(0), *(band.rows[name] for name in fitted)]))
    floor = np.array(errors.noise_floor)
    known = undisturbed(point, x, rows, floor * torque_scale(layout, x))
    between = () if known is None else _rms(errors.residual[rows], known)
    return ResidualSummary(
        layout.joints, errors.rms, errors.rms_validation, errors.noise_floor, errors.spread, between,
        units=errors.units,
    )  # fmt: skip


def _rms(residual: Array, used: Bools) -> tuple[float, ...]:
    """Per joint, of the samples that count, both shape (N, n)."""
    squares = np.sum(used * residual**2, axis=0) / np.maximum(used.sum(axis=0), 1)
    return tuple(map(float, np.sqrt(squares)))
