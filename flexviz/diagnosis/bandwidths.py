"""Data, fits and residuals of one model at several bandwidths, on the same samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz._scipy import sp
from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING
from flexviz.equation import Equation, Layout, Signals, build_signals, equation_stride
from flexviz.errors import InputError
from flexviz.estimation import (
    Bounds,
    Covariance,
    Prior,
    Transfer,
    TwoBandData,
    Whitening,
    gauss_newton,
    least_norm_solve,
    noise_density,
    noise_paths,
    solve,
    spectral_covariance,
)
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase, Observer

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Spans = dict[tuple[int, float], tuple[float, float]]

MAX_STEPS = (6, 4)  # Gauss–Newton steps of the initial fit, at the bandwidth in use, and of each final fit


@dataclass(frozen=True)
class BandwidthData:
    """Data at one bandwidth.

    Attributes:
        bandwidth: [rad/s].
        signals: signals of the single observer, or of the wide band.
        equation: equation of the single observer, or of the narrow band.
        two_band: both bands; None for a single observer.
        own_error: shape (N, n), error of this band's residual [Nm].
    """

    bandwidth: float
    signals: Signals
    equation: Equation
    two_band: TwoBandData | None
    own_error: Array | float = 0.0

    def residual(self, x: Array) -> Array:
        """Residual at x, shape (N, n) [Nm]."""
        equation = self.equation if self.two_band is None else self.two_band.wide
        return equation.at(x).residual(x) - self.own_error


@dataclass(frozen=True)
class BandwidthFit:
    """Parameters at one bandwidth.

    Attributes:
        x: shape (P,).
        covariance: of the parameters.
        at_bound: shape (P,).
        model_error: shape (n,), variance of the model error added to the noise [Nm²].
        influence: shape (D, P), contribution of each second of data to x; sums to nearly zero.
    """

    x: Array
    covariance: Covariance
    at_bound: Bools
    model_error: Array
    influence: Array


# -- the data of each bandwidth ------------------------------------------------------------------------


def refined_bands(
    measurements: MeasurementSet, groups: list[Group], layout: Layout, factors: list[float]
) -> list[BandwidthData]:
    """Data of the diagnosis at several bandwidths.

    In coarse records some factors give the same band; short ones leave no samples in the narrowest bands.
    """
    found: dict[float, BandwidthData] = {}
    for factor in factors:
        weighing = replace(SEARCH_WEIGHTING, hertz=SEARCH_WEIGHTING.hertz * factor, ridge=0.0)
        try:
            two_band = TwoBandData(measurements, groups, layout, weighing)
        except InputError:
            if factor >= 1.0:
                raise
            continue
        signals = two_band.wide.signals
        bandwidth = float(np.max(signals.observer.bandwidth))
        found.setdefault(bandwidth, BandwidthData(bandwidth, signals, two_band.narrow, two_band))
    return list(found.values())


def without_own_error(band: BandwidthData, wider: BandwidthData, x: Array) -> BandwidthData:
    """The band with its residual replaced by the low-passed residual of the wider band.

    Products of narrowly filtered signals differ from the filtered products. This error of the narrow band
    says nothing about the parameters found in the wider one.
    """
    assert isinstance(band.signals.observer, FlatZeroPhase)
    residual, wide = band.residual(x), wider.residual(x)
    there = {key_of(wider, k): b for k, b in enumerate(wider.signals.blocks)}
    error = np.zeros_like(residual)
    for index, own in enumerate(band.signals.blocks):
        if (source := there.get(key_of(band, index))) is None:
            continue
        step = source.segment.step * source.stride
        slow = band.signals.observer.derivatives(wide[source.rows], step, 1)[0]
        formed = sp.interpolate.CubicSpline(wider.signals.time[source.rows], slow)
        error[own.rows] = residual[own.rows] - formed(band.signals.time[own.rows])
    return replace(band, own_error=error)


def plain_bands(
    measurements: MeasurementSet,
    groups: list[Group],
    layout: Layout,
    observer: Observer,
    factors: list[float],
) -> list[BandwidthData]:
    """Data of a single observer at several bandwidths, at common sample times."""
    made = [type(observer)(np.asarray(observer.bandwidth) * f) for f in factors]
    settling = np.array([o.settling() for o in made]).max(axis=0)
    step = min(s.step * equation_stride(s, o, 0.025) for o in made for g in groups for s in g.segments)
    out = []
    for each in made:
        signals = build_signals(
            measurements, groups, each, sample_step=step, exact_step=True, drop=(settling[0], settling[1])
        )
        equation = Equation(measurements.robot, signals, layout)
        out.append(BandwidthData(float(np.max(each.bandwidth)), signals, equation, None))
    return out


def key_of(band: BandwidthData, index: int) -> tuple[int, float]:
    """Key of a block that is common to all bandwidths: its group and start time."""
    block = band.signals.blocks[index]
    return block.group, float(block.segment.time[0])


def spans(bands: list[BandwidthData]) -> Spans:
    """First and last common instant of every stretch that all bandwidths contain [s]."""
    found: dict[tuple[int, float], list[Array]] = {}
    for band in bands:
        for index, block in enumerate(band.signals.blocks):
            found.setdefault(key_of(band, index), []).append(band.signals.time[block.rows][[0, -1]])
    return {
        key: (max(float(e[0]) for e in ends), min(float(e[1]) for e in ends))
        for key, ends in found.items()
        if len(ends) == len(bands)
    }


def seconds(band: BandwidthData, common: Spans) -> Ints:
    """Index of each sample's second within the common spans, shape (N,); −1 outside.

    All bandwidths have to be compared on the same stretches.
    """
    out = np.full(band.signals.count, -1)
    begins, total = {}, 0
    for key, (first, last) in sorted(common.items()):
        begins[key] = total
        total += max(1, int(np.ceil(last - first)))
    for index, block in enumerate(band.signals.blocks):
        key = key_of(band, index)
        if key not in common:
            continue
        first, last = common[key]
        time = band.signals.time[block.rows]
        inside = (time >= first - 1e-9) & (time <= last + 1e-9)
        number = begins[key] + np.minimum((time - first).astype(int), max(0, int(np.ceil(last - first)) - 1))
        out[block.rows] = np.where(inside, number, -1)
    return out


# -- fits ---------------------------------------------------------------------------------------------


def fit_refined(
    band: BandwidthData, prior: Prior, bounds: Bounds, begin: BandwidthFit, seconds: Ints, last: bool
) -> BandwidthFit:
    """Gauss–Newton on Zᵀ W r = b, starting from `begin`.

    The initial fit also estimates the model error, if noise does not explain the residual; the final fits use
    it at every bandwidth.
    """
    assert band.two_band is not None
    two_band = band.two_band.with_model_error(begin.model_error)
    whitening = Whitening(two_band, adapted=not last, own_error=band.own_error, window=seconds >= 0)
    solved = solve(whitening, prior, bounds, begin.x, iterations=MAX_STEPS[last])
    point, model_error = solved.place, whitening.two_band.noise_model.model_error
    if not last:
        return replace(begin, x=point.x, model_error=model_error)
    covariance = point.covariance(prior, not model_error.any(), solved.at_bound)
    influence = _influence(point.sample_scores(), solved.normal.hessian, ~solved.at_bound, seconds)
    return BandwidthFit(point.x, covariance, solved.at_bound, model_error, influence)


def fit_plain(
    band: BandwidthData, prior: Prior, bounds: Bounds, begin: BandwidthFit, seconds: Ints, last: bool
) -> BandwidthFit:
    """Least squares weighted by the size of the residual, starting from `begin`."""
    layout = band.equation.layout
    mask = np.broadcast_to((seconds >= 0)[:, None], band.signals.tau.shape[1:])
    solution = gauss_newton(
        band.equation,
        prior,
        bounds,
        bounds.clip(begin.x),
        mask=mask,
        reweightings=2,
        max_iterations=MAX_STEPS[last],
    )
    if not last:
        return replace(begin, x=solution.x)
    r, z = solution.whitened
    rows, prior_hessian = [b.rows for b in band.signals.blocks], prior.gradient_and_hessian(solution.x)[1]
    covariance = spectral_covariance(r, z, rows, prior_hessian, solution.at_bound)
    flat, each = z.reshape(-1, layout.size), np.einsum("tjp,tj->tp", z, r)
    influence = _influence(each, flat.T @ flat + prior_hessian, ~solution.at_bound, seconds)
    return BandwidthFit(solution.x, covariance, solution.at_bound, begin.model_error, influence)


def _influence(each: Array, hessian: Array, free: Bools, seconds: Ints) -> Array:
    """−H⁻¹ times the score of each second, shape (D, P)."""
    score = np.zeros((int(seconds.max()) + 1, len(hessian)))
    used = seconds >= 0
    np.add.at(score, seconds[used], each[used])
    out = np.zeros_like(score)
    out[:, free] = -least_norm_solve(hessian[np.ix_(free, free)], score[:, free].T).T
    return out


def unfitted(layout: Layout, x: Array) -> BandwidthFit:
    """Start of the initial fit."""
    size = layout.size
    return BandwidthFit(
        x,
        Covariance(np.zeros((size, size)), np.ones(size)),
        np.zeros(size, bool),
        np.zeros(layout.n),
        np.zeros((0, size)),
    )


# -- comparisons --------------------------------------------------------------------------------------


def compared(band: BandwidthData, x: Array, other: BandwidthData, common: Spans, low: FlatZeroPhase) -> Array:
    """Low-passed residual at the samples of another band within the common spans, shape (N', n) [Nm].

    Each stretch is tapered over one cycle of the low-pass at both ends and rescaled to the rms of an
    untapered stretch; without the taper, fast noise at the ends would leak into the pass band.
    """
    residual = band.residual(x)
    ramp = 2 * np.pi / float(np.max(low.bandwidth))  # [s]
    there = {key_of(other, k): b for k, b in enumerate(other.signals.blocks)}
    out = []
    for index, own in enumerate(band.signals.blocks):
        key = key_of(band, index)
        if key not in common:
            continue
        first, last = common[key]
        time = band.signals.time[own.rows]
        fade = np.minimum(time - first, last - time) / min(ramp, 0.5 * (last - first))
        fade = np.sin(0.5 * np.pi * np.clip(fade, 0.0, 1.0)) ** 2
        slow = low.derivatives(residual[own.rows] * fade[:, None], own.segment.step * own.stride, 1)[0]
        slow /= np.sqrt(np.mean(fade[fade > 0] ** 2))
        at = other.signals.time[there[key].rows]
        out.append(sp.interpolate.CubicSpline(time, slow)(at[(at >= first) & (at <= last)]))
    if not out:
        raise InputError("the records are too short for these bandwidths; use higher ones")
    return np.concatenate(out)


def difference(one: BandwidthData, other: BandwidthData) -> Transfer:
    """Difference of two observers' transfer functions."""
    a, b = one.signals.observer, other.signals.observer
    return lambda omega, k: a.transfer(omega, k) - b.transfer(omega, k)


def slow_noise(band: BandwidthData, transfer: Transfer, x: Array, low: FlatZeroPhase) -> Array:
    """Standard deviation of the low-passed residual due to measurement noise, shape (n,) [Nm]."""
    link = band.equation.at(x).link_terms(x)
    paths = noise_paths(band.equation.layout, x, link)
    noise = segments_noise([b.segment for b in band.signals.blocks])
    hertz = np.linspace(0.0, FlatZeroPhase.ratio * float(np.max(low.bandwidth)) / (2 * np.pi), 200)
    total = 0.0
    for block in band.signals.blocks:
        here = [path.rows(block.rows) for path in paths]
        density = noise_density(
            here, noise, lambda w, k: transfer(w, k) * low.transfer(w, 0), block.segment.step, hertz
        )
        total += (
            (block.rows.stop - block.rows.start) / band.signals.count * np.trapezoid(density, hertz, axis=0)
        )
    return np.sqrt(total)
