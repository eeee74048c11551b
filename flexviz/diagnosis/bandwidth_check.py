"""Bandwidth check: physical effects do not depend on the observer's bandwidth.

One model is fitted to the same samples at several bandwidths.

- The residual at fixed parameters, low-passed well inside every band, must not change. A change above the
  noise level is observer error: lag, droop, or motion beyond the band.
- Every parameter, fitted at each bandwidth, must stay within its standard error. Otherwise it is unreliable,
  however narrow its interval: its value depends on frequencies at which the model is wrong.

The observer is either the two bands of the diagnosis, which noise does not bias, or any single observer with
a least-squares fit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.bandwidths import (
    BandwidthData,
    BandwidthFit,
    Spans,
    compared,
    difference,
    fit_plain,
    fit_refined,
    plain_bands,
    refined_bands,
    seconds,
    slow_noise,
    spans,
    unfitted,
    without_own_error,
)
from flexviz.diagnosis.fit_context import search_bounds
from flexviz.diagnosis.records import BandwidthCheck, ParameterCurve
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Layout
from flexviz.estimation import WIDE_HERTZ, Prior, base_parameters, start_values
from flexviz.identification import ParameterEstimate, combinations, parameter_estimates
from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import FlatZeroPhase, Observer
from flexviz.statistics import NORMAL_95

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

TWO_BAND_FACTORS = (0.3, 0.4, 0.55, 1.0, 1.25)  # bandwidths relative to the one in use
PLAIN_FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)  # the same for a single observer
# residuals are compared up to this share of the narrowest bandwidth; flat bands have no droop
COMPARED_SHARE, COMPARED_SHARE_FLAT = 0.5, 1.0
LIMITS = THRESHOLDS.evidence


def check_bandwidth(
    measurements: MeasurementSet,
    layout: Layout,
    x: Array,
    *,
    observer: Observer | None = None,
    factors: Sequence[float] | None = None,
    groups: Sequence[Group] | None = None,
    check: Callable[[], None] = lambda: None,
) -> BandwidthCheck:
    """Fit a model at several bandwidths.

    Args:
        measurements: the measurement set.
        layout, x: the model, fitted at the bandwidth in use; x has shape (P,).
        observer: the observer in use, with its bandwidth; None for the two bands of the diagnosis.
        factors: bandwidths relative to the one in use; 1 is always included. Default: `TWO_BAND_FACTORS` or
            `PLAIN_FACTORS`.
        groups: groups to fit; default: all but the validation groups.
        check: called between fits; may raise to stop.
    """
    began = time.perf_counter()
    chosen = [g for g in measurements.groups if not g.validation] if groups is None else list(groups)
    factors = (TWO_BAND_FACTORS if observer is None else PLAIN_FACTORS) if factors is None else factors
    tried = sorted({1.0, *factors})
    if observer is None:
        bands = refined_bands(measurements, chosen, layout, tried)
        widest = max(b.bandwidth for b in bands)
        in_use = [b.bandwidth for b in bands].index(min(2 * np.pi * WIDE_HERTZ, widest))
    else:
        bands, in_use = plain_bands(measurements, chosen, layout, observer, tried), tried.index(1.0)
    start = start_values(measurements, bands[in_use].equation)
    prior, bounds = start.prior, search_bounds(start, layout)
    common = spans(bands)
    when = [seconds(band, common) for band in bands]
    fit = fit_refined if observer is None else fit_plain
    begin = fit(bands[in_use], prior, bounds, unfitted(layout, x), when[in_use], False)
    fits: list[BandwidthFit] = []
    for band, used in zip(bands, when, strict=True):
        check()
        if observer is None and FlatZeroPhase.ratio * band.bandwidth <= bands[in_use].bandwidth:
            band = without_own_error(band, bands[in_use], begin.x)
        fits.append(fit(band, prior, bounds, begin, used, True))
    top = min(b.bandwidth for b in bands) * (COMPARED_SHARE_FLAT if observer is None else COMPARED_SHARE)
    slow = FlatZeroPhase(top / FlatZeroPhase.ratio)
    residuals = _compare_residuals(bands, in_use, fits, common, slow, check)
    return BandwidthCheck(
        observer="two bands" if observer is None else observer.name,
        bandwidths=np.array([b.bandwidth for b in bands]),
        in_use=in_use,
        joints=layout.joints,
        rms=residuals.rms,
        noise_floor=residuals.noise_floor,
        change=residuals.change,
        change_noise=residuals.change_noise,
        band=top,
        observer_error=residuals.observer_error(in_use),
        parameters=_parameter_curves(measurements, layout, fits, in_use, prior, wider=observer is not None),
        seconds=time.perf_counter() - began,
    )


@dataclass(frozen=True, eq=False)
class _ResidualComparison:
    """The low-passed residual at every bandwidth, compared with the bandwidth in use.

    Attributes:
        size: shape (n,), rms at the bandwidth in use [Nm].
        rms, noise_floor, change, change_noise: as in `BandwidthCheck`.
    """

    size: Array
    rms: Array
    noise_floor: Array
    change: Array
    change_noise: Array

    def observer_error(self, in_use: int) -> Bools:
        """Joints whose residual changes with a wider band, shape (n,)."""
        noise = np.maximum(self.change_noise, self.noise_floor)
        beyond = (self.change > LIMITS.change * noise) & (self.change > LIMITS.change_share * self.size)
        beyond[:in_use] = False  # errors of a narrower band do not affect the one in use
        return np.any(beyond, axis=0, keepdims=False).astype(bool)


def _compare_residuals(
    bands: Sequence[BandwidthData],
    in_use: int,
    fits: Sequence[BandwidthFit],
    common: Spans,
    low: FlatZeroPhase,
    check: Callable[[], None],
) -> _ResidualComparison:
    """Change of the residual at the parameters in use; its rms at the parameters of each bandwidth."""
    used, reference = bands[in_use], fits[in_use].x
    base = compared(used, reference, used, common, low)
    rms, change, noise = [], [], []
    for band, fit in zip(bands, fits, strict=True):
        check()
        here = base if band is used else compared(band, reference, used, common, low)
        own = here if band is used else compared(band, fit.x, used, common, low)
        change.append(_rms(here - base))
        rms.append(_rms(own))
        noise.append(slow_noise(used, difference(band, used), reference, low))
    floor = slow_noise(used, used.signals.observer.transfer, reference, low)
    return _ResidualComparison(_rms(base), np.array(rms), floor, np.array(change), np.array(noise))


def _rms(residual: Array) -> Array:
    return np.sqrt(np.mean(residual**2, axis=0))


def _parameter_curves(
    measurements: MeasurementSet,
    layout: Layout,
    fits: Sequence[BandwidthFit],
    in_use: int,
    prior: Prior,
    wider: bool,
) -> tuple[ParameterCurve, ...]:
    """Identifiable parameters over the bandwidth; for inertias, the identifiable combinations.

    `wider`: whether bands wider than the one in use count. The two bands are as wide as they can be: in a
    wider one, noise biases the parameters even of a correct model.
    """
    base = base_parameters(measurements.robot)
    inertial = layout.inertial.stop
    rows, differences = [], []
    for f in fits:
        single = parameter_estimates(layout, f.x, f.x, f.covariance, f.at_bound, prior)
        rows.append((*single[inertial:], *combinations(base, layout, f.x, f.covariance.matrix, prior)))
        # the two fits share their data: their difference has a standard error of its own
        apart = f.influence - fits[in_use].influence
        cov = apart.T @ apart
        between = replace(f.covariance, matrix=cov)
        single = parameter_estimates(layout, f.x, f.x, between, f.at_bound, prior)
        both = (*single[inertial:], *combinations(base, layout, f.x, cov, prior))
        differences.append([p.std for p in both])
    out = []
    for column, apart in zip(zip(*rows, strict=True), np.array(differences).T, strict=True):
        first = column[in_use]
        held = [isinstance(p, ParameterEstimate) and p.at_bound for p in column]
        if first.identifiable == "no" or held[in_use]:
            continue
        values = np.array([np.nan if h else p.value for p, h in zip(column, held, strict=True)])
        std = np.array([np.nan if h else p.std for p, h in zip(column, held, strict=True)])
        distance = np.abs(values - first.value)
        moved = distance / max(first.std, 1e-300)
        excuse = distance / np.maximum(apart, 1e-300)
        excuse[in_use] = 0.0
        joint, place = None, None
        if isinstance(first, ParameterEstimate):
            joint, place = first.joint, first.payload or first.group
        beyond = np.nan_to_num(np.minimum(moved / NORMAL_95, excuse / LIMITS.deviations))
        if not wider:
            beyond[in_use + 1 :] = 0.0
        worst = int(np.argmax(beyond))
        out.append(
            ParameterCurve(
                name=first.name,
                joint=joint,
                unit=first.unit,
                place=place,
                values=values,
                std=std,
                moved=float(moved[worst]),
                excuse=float(excuse[worst]),
                trusted=bool(beyond[worst] < 1.0),
            )
        )
    return tuple(out)
