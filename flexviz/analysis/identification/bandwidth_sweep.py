"""Residual against observer bandwidth.

The paper chooses the bandwidth with the least torque error. This says little about the parameters of a causal
observer, whose states lag differently; the sweep therefore also reports the parameters at every bandwidth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np

from flexviz.analysis.identification.pipeline import identify
from flexviz.analysis.identification.result import Identification
from flexviz.analysis.identification.settings import FitOptions, fit_settings
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.progress import Progress, ProgressCallback, StopCallback
from flexviz.data.measurements import MeasurementSet, set_of


@dataclass(frozen=True)
class SweepResult:
    """Plain fits at several bandwidths.

    Attributes:
        observer: name of the observer.
        bandwidths: shape (M,) [rad/s].
        rms_fit: shape (M, n) [Nm].
        rms_validation: shape (M, n) [Nm]; NaN without validation groups.
        stiffness, motor_inertia: shape (M, n), estimates at each bandwidth [Nm/rad], [kg m²].
        best: the bandwidth of least held-out error (of least error where nothing is held out), each joint
            counted in units of its own least error [rad/s].
    """

    observer: str
    bandwidths: Array
    rms_fit: Array
    rms_validation: Array
    stiffness: Array
    motor_inertia: Array
    best: float


def sweep(
    measurements: MeasurementSet | str | Path,
    observer: str,
    bandwidths: Sequence[float] | Array,
    /,
    *,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    **options: Unpack[FitOptions],
) -> SweepResult:
    """Identify at each bandwidth and compare the errors.

    The residual is large where the filter removes motion and where it passes noise. A stiffness that changes
    where the residual is flat is an error of the observer.

    Args:
        measurements: the set, or its folder.
        observer: its name.
        bandwidths: [rad/s], at least one; those too narrow for the records are left out.
        progress: called after each fit.
        should_stop: asked between fits; what is done so far is returned (at least one fit is made).
        options: further fields of `FitSettings`; nothing is refined.

    Raises:
        InputError: when no bandwidth is wide enough for the records.
    """
    measurements = set_of(measurements)
    settings = replace(fit_settings(None, **options), observer=observer, refine=False)
    rows = []
    n = len(measurements.joints)
    refused: InputError | None = None
    for done, w in enumerate(bandwidths):
        if rows and should_stop is not None and should_stop():
            break
        try:
            result = identify(measurements, settings, bandwidth=float(w))
        except InputError as error:
            refused = error
            continue
        rows.append(
            (
                float(w),
                _rms(result, result.groups, n),
                _rms(result, result.validation_groups, n),
                result.model.stiffness,
                result.model.motor_inertia,
            )
        )
        if progress is not None:
            total = len(bandwidths)
            progress(Progress(f"{done + 1} of {total} bandwidths", (done + 1) / total))
    if not rows:
        raise refused or InputError("no bandwidth to try was given")
    tried, fit, validation, stiffness, inertia = (np.array(column) for column in zip(*rows, strict=True))
    judged = fit if np.isnan(validation).any() else validation
    best = float(tried[int(np.argmin((judged / judged.min(axis=0)).mean(axis=1)))])
    return SweepResult(observer, tried, fit, validation, stiffness, inertia, best)


def _rms(result: Identification, groups: Sequence[str], n: int) -> Array:
    """Rms residual of groups with the observer that is tried, shape (n,) [Nm]; NaN without any."""
    found = [result.residuals[name].residual for name in groups if name in result.residuals]
    return np.sqrt(np.mean(np.concatenate(found) ** 2, axis=0)) if found else np.full(n, np.nan)
