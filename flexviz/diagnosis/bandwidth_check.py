"""Observer guard: what moves with the observer's bandwidth is not physics.

The same model is held against the same samples at several bandwidths.

- The residual at fixed parameters, low-passed far inside every band, must not change. Where it does, and by
  more than the noise, the observer (its lag, its droop, or motion beyond its band) makes part of it.
- The parameters, fitted anew at every bandwidth, must stay within their standard errors. One that does not
  is not to be trusted, however small its interval: it owes its value to frequencies at which the model is
  wrong.

Two kinds of observer: the diagnosis' own two bands (`identification.refine`), which are free of bias by
noise, or any single one, fitted plainly.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.bandwidths import (
    BandwidthFit,
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
from flexviz.equation import Layout
from flexviz.estimation import WIDE_HERTZ, Prior, base_parameters, start_values
from flexviz.identification import ParameterEstimate, combinations, parameter_estimates
from flexviz.measurements import Group, MeasurementSet
from flexviz.observers import FlatZeroPhase, Observer
from flexviz.statistics import NORMAL_95

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

FACTORS = (0.3, 0.4, 0.55, 1.0, 1.25)  # of the two bands' bandwidth
PLAIN_FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)  # of a single observer's
# of the narrowest bandwidth: up to there the residuals are compared; the two bands are flat up to their end
COMMON, COMMON_FLAT = 0.5, 1.0
MOVED = 3.0  # standard errors of the difference itself
CHANGED = 1.0  # times the noise by which a residual has to change
WORTH = 0.1  # of the residual, and by that much of it


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
        measurements: the set.
        layout, x: the model, fitted at the bandwidth in use; x has shape (P,).
        observer: the one in use, with its bandwidth; the diagnosis' own two bands where None.
        factors: of its bandwidth; 1 is always among them. `FACTORS` or `PLAIN_FACTORS` where None.
        groups: to fit; all but the validation groups where None.
        check: called between fits; may raise to stop.
    """
    began = time.perf_counter()
    chosen = [g for g in measurements.groups if not g.validation] if groups is None else list(groups)
    factors = (FACTORS if observer is None else PLAIN_FACTORS) if factors is None else factors
    tried = sorted({1.0, *factors})
    if observer is None:
        bands = refined_bands(measurements, chosen, layout, tried)
        widest = max(b.bandwidth for b in bands)
        in_use = [b.bandwidth for b in bands].index(min(2 * np.pi * WIDE_HERTZ, widest))
    else:
        bands, in_use = plain_bands(measurements, chosen, layout, observer, tried), tried.index(1.0)
    start = start_values(measurements, bands[in_use].equation)
    prior, bounds = start.prior, search_bounds(start, layout)
    common_spans = spans(bands)
    when = [seconds(band, common_spans) for band in bands]
    fit = fit_refined if observer is None else fit_plain
    begin = fit(bands[in_use], prior, bounds, unfitted(layout, x), when[in_use], False)
    fitted: list[BandwidthFit] = []
    for band, used in zip(bands, when, strict=True):
        check()
        if observer is None and FlatZeroPhase.ratio * band.bandwidth <= bands[in_use].bandwidth:
            band = without_own_error(band, bands[in_use], begin.x)
        fitted.append(fit(band, prior, bounds, begin, used, True))
    common = (COMMON_FLAT if observer is None else COMMON) * min(b.bandwidth for b in bands)
    low = FlatZeroPhase(common / FlatZeroPhase.ratio)
    reference = fitted[in_use].x
    base = compared(bands[in_use], reference, bands[in_use], common_spans, low)
    floor = slow_noise(bands[in_use], bands[in_use].signals.observer.transfer, reference, low)
    rms, change, explained = [], [], []
    for index, band in enumerate(bands):
        check()
        here = base if index == in_use else compared(band, reference, bands[in_use], common_spans, low)
        change.append(np.sqrt(np.mean((here - base) ** 2, axis=0)))
        own = here if index == in_use else compared(band, fitted[index].x, bands[in_use], common_spans, low)
        rms.append(np.sqrt(np.mean(own**2, axis=0)))
        explained.append(slow_noise(bands[in_use], difference(band, bands[in_use]), reference, low))
    change, rms, explained = np.array(change), np.array(rms), np.array(explained)
    size = np.sqrt(np.mean(base**2, axis=0))
    beyond = (change > CHANGED * np.maximum(explained, floor)) & (change > WORTH * size)
    beyond[:in_use] = False  # what a narrower band would do wrong is no error of the one in use
    return BandwidthCheck(
        "two bands" if observer is None else observer.name,
        np.array([b.bandwidth for b in bands]),
        in_use,
        layout.joints,
        rms,
        floor,
        change,
        explained,
        common,
        beyond.any(axis=0),
        _curves(measurements, layout, fitted, in_use, prior, wider=observer is not None),
        time.perf_counter() - began,
    )


def _curves(
    measurements: MeasurementSet,
    layout: Layout,
    fitted: list[BandwidthFit],
    in_use: int,
    prior: Prior,
    wider: bool,
) -> tuple[ParameterCurve, ...]:
    """What the data determine, over the bandwidth: of the inertias only their identifiable combinations.

    `wider` says whether wider bands than the one in use may accuse a parameter. The two bands' is as wide as
    it can be: beyond it, noise begins to pull at the parameters, which is no fault of theirs.
    """
    base = base_parameters(measurements.robot)
    inertial = layout.inertial.stop
    rows, differences = [], []
    for f in fitted:
        single = parameter_estimates(layout, f.x, f.x, f.covariance, f.at_bound, prior)
        rows.append((*single[inertial:], *combinations(base, layout, f.x, f.covariance.matrix, prior)))
        # the two fits share their data: the standard error of their difference is not that of either
        apart = f.influence - fitted[in_use].influence
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
        beyond = np.nan_to_num(np.minimum(moved / NORMAL_95, excuse / MOVED))
        if not wider:
            beyond[in_use + 1 :] = 0.0
        worst = int(np.argmax(beyond))
        trusted = bool(beyond[worst] < 1.0)
        out.append(
            ParameterCurve(
                first.name, joint, first.unit, place, values, std, float(moved[worst]), float(excuse[worst]),
                trusted,
            )
        )  # fmt: skip
    return tuple(out)
