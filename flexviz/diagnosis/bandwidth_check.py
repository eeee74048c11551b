"""Bandwidth check: physical effects do not depend on the observer's bandwidth.

One model is fitted to the same samples at several bandwidths of the diagnosis.

- The residual at fixed parameters, low-passed well inside every band, must not change. A change above the
  noise level is observer error: lag, droop, or motion beyond the band.
- Every parameter, fitted at each bandwidth, must stay within its standard error. Otherwise it is unreliable,
  however narrow its interval: its value depends on frequencies at which the model is wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz._scipy import sp
from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING, search_bounds
from flexviz.diagnosis.records import BandwidthCheck, ParameterCurve
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Block, Layout
from flexviz.errors import InputError
from flexviz.estimation import (
    WIDE_HERTZ,
    Bounds,
    Covariance,
    Prior,
    TwoBandData,
    Whitening,
    base_parameters,
    least_norm_solve,
    noise_density,
    noise_paths,
    solve,
    start_values,
)
from flexviz.identification import Combination, ParameterEstimate, combinations, parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.observers import FlatZeroPhase
from flexviz.statistics import NORMAL_95

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Key = tuple[int, float]  # of a stretch at all bandwidths: its group and start time
Spans = dict[Key, tuple[float, float]]

FACTORS = (0.3, 0.4, 0.55, 1.0, 1.25)  # bandwidths relative to the one in use
STEPS = 6  # Gauss–Newton steps of a fit
LIMITS = THRESHOLDS.evidence


@dataclass(frozen=True)
class BandwidthFit:
    """Parameters at one bandwidth.

    Attributes:
        x: shape (P,).
        covariance: of the parameters.
        at_bound: shape (P,).
        influence: shape (D, P), contribution of each second of data to x; sums to nearly zero.
    """

    x: Array
    covariance: Covariance
    at_bound: Bools
    influence: Array


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
    in_use = bands.index(used)
    start = start_values(measurements, used.narrow)
    prior, bounds = start.prior, search_bounds(start, layout)
    common = spans(bands[0])
    # it also estimates the model error, if noise does not explain the residual
    whitening = Whitening(used, adapted=True, window=seconds(used, common) >= 0)
    begin = solve(whitening, prior, bounds, x, iterations=STEPS).place.x
    model_error = whitening.two_band.noise_model.model_error
    fits: list[BandwidthFit] = []
    for band in bands:
        check()
        fits.append(fit_band(band.with_model_error(model_error), prior, bounds, begin, seconds(band, common)))
    reference, top = fits[in_use].x, bandwidth(bands[0])
    low = FlatZeroPhase(top / FlatZeroPhase.ratio)
    base = compared(used, reference, used, common, low)
    rms, change = [], []
    for band, fit in zip(bands, fits, strict=True):
        check()
        change.append(_rms(compared(band, reference, used, common, low) - base))
        rms.append(_rms(compared(band, fit.x, used, common, low)))
    floor = slow_noise(used, reference, low)
    least = np.maximum(LIMITS.change * floor, LIMITS.change_share * _rms(base))
    return BandwidthCheck(
        bandwidths=np.array([bandwidth(b) for b in bands]),
        in_use=in_use,
        joints=layout.joints,
        rms=np.array(rms),
        noise_floor=floor,
        change=np.array(change),
        band=top,
        # errors of a narrower band do not affect the one in use
        observer_error=np.max(change[in_use:], axis=0) > least,
        parameters=_parameter_curves(measurements, layout, fits, in_use, prior),
        seconds=time.perf_counter() - began,
    )


def _rms(residual: Array) -> Array:
    return np.sqrt(np.mean(residual**2, axis=0))


def bandwidth(band: TwoBandData) -> float:
    """Of the wide band [rad/s]."""
    return float(np.max(band.wide.signals.observer.bandwidth))


def stretches(band: TwoBandData) -> dict[Key, Block]:
    """Contiguous samples by their group and start time, which are the same at all bandwidths."""
    return {(b.group, float(b.segment.time[0])): b for b in band.blocks}


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


def spans(narrowest: TwoBandData) -> Spans:
    """First and last instant of every stretch of the narrowest band, which all bands contain [s]."""
    time, rows = narrowest.wide.signals.time, {key: b.rows for key, b in stretches(narrowest).items()}
    return {key: (float(time[r.start]), float(time[r.stop - 1])) for key, r in sorted(rows.items())}


def seconds(band: TwoBandData, common: Spans) -> Ints:
    """Index of each sample's second within the common spans, shape (N,); −1 outside."""
    out, blocks, total = np.full(band.wide.signals.count, -1), stretches(band), 0
    for key, (first, last) in common.items():
        rows, count = blocks[key].rows, max(1, int(np.ceil(last - first)))
        time = band.wide.signals.time[rows]
        number = total + np.clip((time - first).astype(int), 0, count - 1)
        out[rows] = np.where((time >= first - 1e-9) & (time <= last + 1e-9), number, -1)
        total += count
    return out


def fit_band(band: TwoBandData, prior: Prior, bounds: Bounds, x: Array, seconds: Ints) -> BandwidthFit:
    """Gauss–Newton on Zᵀ W r = b from x, shape (P,); `seconds`, shape (N,): index of each sample's second."""
    used = seconds >= 0
    whitening = Whitening(band, window=used)
    solved = solve(whitening, prior, bounds, x, iterations=STEPS)
    point, from_noise = solved.place, not band.noise_model.model_error.any()
    covariance = point.covariance(prior, from_noise, solved.at_bound)
    # −H⁻¹ times the score of each second
    score, free = np.zeros((int(seconds.max()) + 1, len(x))), ~solved.at_bound
    np.add.at(score, seconds[used], point.sample_scores()[used])
    influence = np.zeros_like(score)
    hessian = solved.normal.hessian[np.ix_(free, free)]
    influence[:, free] = -least_norm_solve(hessian, score[:, free].T).T
    return BandwidthFit(point.x, covariance, solved.at_bound, influence)


def compared(band: TwoBandData, x: Array, other: TwoBandData, common: Spans, low: FlatZeroPhase) -> Array:
    """Low-passed residual at the samples of another band within the common spans, shape (N', n) [Nm].

    Each stretch is tapered over one cycle of the low-pass at both ends, where fast noise would leak into the
    pass band, and rescaled to the rms of an untapered stretch.
    """
    residual = band.residual(band.wide.at(x), x)
    ramp = 2 * np.pi / float(np.max(low.bandwidth))  # [s]
    mine, there, out = stretches(band), stretches(other), []
    for key, (first, last) in common.items():
        own = mine[key]
        time = band.wide.signals.time[own.rows]
        fade = np.minimum(time - first, last - time) / min(ramp, 0.5 * (last - first))
        fade = np.sin(0.5 * np.pi * np.clip(fade, 0.0, 1.0)) ** 2
        slow = low.derivatives(residual[own.rows] * fade[:, None], own.segment.step * own.stride, 1)[0]
        slow /= np.sqrt(np.mean(fade[fade > 0] ** 2))
        at = other.wide.signals.time[there[key].rows]
        out.append(sp.interpolate.CubicSpline(time, slow)(at[(at >= first) & (at <= last)]))
    return np.concatenate(out)


def slow_noise(band: TwoBandData, x: Array, low: FlatZeroPhase) -> Array:
    """Standard deviation of the low-passed residual due to measurement noise, shape (n,) [Nm]."""
    equation, signals = band.narrow, band.wide.signals
    paths = noise_paths(equation.layout, x, equation.at(x).link_terms(x))
    hertz = np.linspace(0.0, FlatZeroPhase.ratio * float(np.max(low.bandwidth)) / (2 * np.pi), 200)
    gain = np.abs(low.transfer(2 * np.pi * hertz, 0))[:, None] ** 2
    total = np.zeros(equation.layout.n)
    for block in signals.blocks:
        here, step = [path.rows(block.rows) for path in paths], block.segment.step
        density = noise_density(here, band.noise, signals.observer.transfer, step, hertz)
        total += (block.rows.stop - block.rows.start) * np.trapezoid(gain * density, hertz, axis=0)
    return np.sqrt(total / signals.count)


def _parameter_curves(
    measurements: MeasurementSet, layout: Layout, fits: Sequence[BandwidthFit], in_use: int, prior: Prior
) -> tuple[ParameterCurve, ...]:
    """Identifiable parameters over the bandwidth; for inertias, the identifiable combinations.

    A band wider than the one in use does not count: in a wider one, noise biases the parameters even of a
    correct model.
    """
    base = base_parameters(measurements.robot)

    def estimates(fit: BandwidthFit, matrix: Array) -> list[Combination | ParameterEstimate]:
        covariance = replace(fit.covariance, matrix=matrix)
        single = parameter_estimates(layout, fit.x, fit.x, covariance, fit.at_bound, prior)
        return [*single[layout.inertial.stop :], *combinations(base, layout, fit.x, matrix, prior)]

    rows, differences, out = [], [], []
    for fit in fits:
        rows.append(estimates(fit, fit.covariance.matrix))
        # the two fits share their data: their difference has a standard error of its own
        apart = fit.influence - fits[in_use].influence
        differences.append([p.std for p in estimates(fit, apart.T @ apart)])
    for column, apart in zip(zip(*rows, strict=True), np.array(differences).T, strict=True):
        first = column[in_use]
        held = np.array([isinstance(p, ParameterEstimate) and p.at_bound for p in column])
        if first.identifiable == "no" or held[in_use]:
            continue
        values, std = (
            np.where(held, np.nan, [getattr(p, name) for p in column]) for name in ("value", "std")
        )
        moved = np.abs(values - first.value) / max(first.std, 1e-300)
        excuse = np.abs(values - first.value) / np.maximum(apart, 1e-300)
        beyond = np.nan_to_num(np.minimum(moved / NORMAL_95, excuse / LIMITS.deviations))
        beyond[in_use:] = 0.0
        worst = int(np.argmax(beyond)) if beyond.any() else in_use
        single = first if isinstance(first, ParameterEstimate) else None
        out.append(
            ParameterCurve(
                name=first.name,
                joint=single and single.joint,
                unit=first.unit,
                place=single and (single.payload or single.group),
                values=values,
                std=std,
                moved=float(moved[worst]),
                trusted=bool(beyond[worst] < 1.0),
            )
        )
    return tuple(out)
