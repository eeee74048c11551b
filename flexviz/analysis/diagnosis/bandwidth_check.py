"""Bandwidth check: physical effects do not depend on the observer's bandwidth.

One model is fitted at several bandwidths of the diagnosis.

- The residual at fixed parameters, low-passed well inside every band, must not change. A change above the
  noise level is observer error: lag, droop, or motion beyond the band.
- Every parameter, fitted at each bandwidth, must stay within its standard error. Otherwise it is unreliable,
  however narrow its interval: its value depends on frequencies at which the model is wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import SEARCH_WEIGHTING, search_bounds
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import (
    MAX_ITERATIONS,
    WIDE_HERTZ,
    Bounds,
    Covariance,
    Prior,
    TwoBandData,
    Whitening,
    base_parameters,
    residual_noise,
    solve,
    start_values,
)
from flexviz.analysis.identification import combinations, parameter_estimates
from flexviz.analysis.motion import MOTION
from flexviz.base._scipy import sp
from flexviz.base.errors import InputError
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import Combination, ParameterEstimate
from flexviz.content.results import BandwidthCheck, ParameterCurve
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Layout
from flexviz.model.observers import FlatZeroPhase

Array = NDArray[np.float64]

FACTORS = (0.3, 0.4, 0.55, 1.0, 1.25)  # bandwidths relative to the one in use


class BandwidthFit(NamedTuple):
    """Parameters at one bandwidth, shape (P,), their covariance, and which are at a bound, shape (P,)."""

    x: Array
    covariance: Covariance
    at_bound: NDArray[np.bool_]


def check_bandwidth(
    measurements: MeasurementSet, layout: Layout, x: Array, *, check: Callable[[], None] = lambda: None
) -> BandwidthCheck:
    """Fit a model at several bandwidths.

    Args:
        measurements: the set; its validation groups are not used.
        layout, x: the model, fitted at the bandwidth in use; x has shape (P,).
        check: called between fits; may raise to stop.
    """
    began = time.perf_counter()
    bands = bandwidths(measurements, layout, FACTORS)
    used = min(bands, key=lambda band: abs(bandwidth(band) - 2 * np.pi * WIDE_HERTZ))
    in_use, start = bands.index(used), start_values(measurements, used.narrow)
    prior, bounds = start.prior, search_bounds(start, layout)
    # it also estimates the model error, if noise does not explain the residual
    whitening = Whitening(used, adapted=True)
    begin = solve(whitening, prior, bounds, x, iterations=MAX_ITERATIONS).place.x
    model_error = whitening.two_band.noise_model.model_error
    fits, rms, change = [], [], []
    for band in bands:
        check()
        fits.append(fit_band(band.with_model_error(model_error), prior, bounds, begin))
    reference, top, slowest = fits[in_use].x, bandwidth(bands[0]), bands[0].wide
    low = FlatZeroPhase(top / FlatZeroPhase.ratio)

    def compared(band: TwoBandData, x: Array) -> Array:
        return low_passed(band, x, low, bands[0], used)

    base = compared(used, reference)
    for band, fit in zip(bands, fits, strict=True):
        check()
        change.append(_rms(compared(band, reference) - base))
        rms.append(_rms(compared(band, fit.x)))
    link = slowest.at(reference).link_terms(reference)
    passed = replace(slowest.signals, observer=low)
    floor = np.sqrt(residual_noise(passed, layout, reference, link, bands[0].noise))
    # errors of a narrower band do not affect the one in use
    wrong = np.max(change[in_use:], axis=0) > np.maximum(floor, THRESHOLDS.evidence.share * _rms(base))
    curves = _parameter_curves(measurements, layout, fits, in_use, prior)
    return BandwidthCheck(
        np.array([bandwidth(b) for b in bands]), in_use, layout.joints, np.array(rms), floor,
        np.array(change), top, wrong, curves, time.perf_counter() - began,
        units=measurements.torque_units,
    )  # fmt: skip


def _rms(residual: Array) -> Array:
    return np.sqrt(np.mean(residual**2, axis=0))


def bandwidth(band: TwoBandData) -> float:
    """Of the wide band [rad/s]."""
    return float(np.max(band.wide.signals.observer.bandwidth))


def bandwidths(measurements: MeasurementSet, layout: Layout, factors: Sequence[float]) -> list[TwoBandData]:
    """Data of the fit groups at several bandwidths, ascending.

    In coarse records some factors give the same band; short ones leave no samples in the narrowest bands.
    There, products of filtered signals differ from the filtered products, which are formed instead.
    """
    found: dict[float, TwoBandData] = {}
    for factor in sorted(factors):
        hertz, narrow = SEARCH_WEIGHTING.hertz * factor, FlatZeroPhase.ratio * factor <= 1
        weighing = replace(SEARCH_WEIGHTING, hertz=hertz, ridge=0.0, products=narrow)
        try:
            band = TwoBandData(measurements, measurements.fit_groups, layout, weighing)
        except InputError:
            if factor >= 1.0:
                raise
            continue
        found.setdefault(bandwidth(band), band)
    return [found[key] for key in sorted(found)]


def fit_band(band: TwoBandData, prior: Prior, bounds: Bounds, x: Array) -> BandwidthFit:
    """Gauss–Newton on Zᵀ W r = b from x, shape (P,)."""
    solved = solve(Whitening(band), prior, bounds, x, iterations=MAX_ITERATIONS)
    from_noise = not band.noise_model.model_error.any()
    covariance = solved.place.covariance(prior, from_noise, solved.at_bound)
    return BandwidthFit(solved.place.x, covariance, solved.at_bound)


def low_passed(
    band: TwoBandData, x: Array, low: FlatZeroPhase, narrowest: TwoBandData, other: TwoBandData
) -> Array:
    """Low-passed residual at the samples of another band where the narrowest has some, shape (N', n) [Nm].

    Each stretch is tapered over one cycle of the low-pass at both ends, where fast noise would leak into the
    pass band, and rescaled to the rms of an untapered stretch.
    """
    residual = band.residual(band.wide.at(x), x)
    ramp = 2 * np.pi / float(np.max(low.bandwidth))  # [s]
    blocks = [{(b.group, b.segment.time[0]): b for b in one.blocks} for one in (narrowest, band, other)]
    out = []
    for key, inner in blocks[0].items():
        own, there = blocks[1][key], blocks[2][key]
        time, at = band.wide.signals.time[own.rows], other.wide.signals.time[there.rows]
        first, last = narrowest.wide.signals.time[inner.rows][[0, -1]]
        fade = np.minimum(time - first, last - time) / min(ramp, 0.5 * (last - first))
        fade = np.sin(0.5 * np.pi * np.clip(fade, 0.0, 1.0)) ** 2
        slow = low.derivatives(residual[own.rows] * fade[:, None], own.segment.step * own.stride, 1)[0]
        slow /= np.sqrt(np.mean(fade[fade > 0] ** 2))
        out.append(sp.interpolate.CubicSpline(time, slow)(at[(at >= first) & (at <= last)]))
    return np.concatenate(out)


def _parameter_curves(
    measurements: MeasurementSet, layout: Layout, fits: Sequence[BandwidthFit], in_use: int, prior: Prior
) -> tuple[ParameterCurve, ...]:
    """Identifiable parameters over the bandwidth; for inertias, the identifiable combinations.

    A band wider than the one in use does not count: in a wider one, noise biases the parameters even of a
    correct model. The difference from an efficient estimate has the difference of the variances (Hausman,
    Econometrica 46, 1978).
    """
    base = base_parameters(measurements.robot)

    def estimates(fit: BandwidthFit) -> list[Combination | ParameterEstimate]:
        single = parameter_estimates(layout, fit.x, fit.x, fit.covariance, fit.at_bound, prior)
        return [
            *single[layout.inertial.stop :],
            *combinations(base, layout, fit.x, fit.covariance.matrix, prior),
        ]

    out = []
    for column in zip(*map(estimates, fits), strict=True):
        first = column[in_use]
        held = np.array([isinstance(p, ParameterEstimate) and p.at_bound for p in column])
        if first.identifiable == "no" or held[in_use]:
            continue
        pairs = np.array([(p.value, p.std) for p in column])
        values, std = np.where(held[:, None], np.nan, pairs).T
        change = np.nan_to_num(np.abs(values - first.value))[:in_use]
        apart = np.nan_to_num(np.sqrt(np.maximum(std**2 - first.std**2, 0.0)))[:in_use]
        allowed = np.maximum(NORMAL_95 * first.std, MOTION.outlier * apart)
        single = first if isinstance(first, ParameterEstimate) else None
        joint, place = (single.joint, single.payload or single.group) if single else (None, None)
        moved = float(np.max(change, initial=0.0)) / max(first.std, 1e-300)
        trusted = bool(np.all(change <= allowed))
        out.append(ParameterCurve(first.name, joint, first.unit, place, values, std, moved, trusted))
    return tuple(out)
