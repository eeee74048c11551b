"""One model's data, fits and residuals at several bandwidths, on the same samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING
from flexviz.diagnosis.residuals import noise_density
from flexviz.equation import Equation, Layout, Signals, build_signals, equation_stride
from flexviz.errors import InputError
from flexviz.estimation import (
    CONSISTENT,
    TOLERANCE,
    Bounds,
    Prior,
    Transfer,
    TwoBandData,
    bounded_step,
    compensated_score,
    covariance,
    evaluated,
    feasible_step,
    gauss_newton,
    noise_paths,
    score_covariance,
    shared_part,
    weighted_point,
)
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase, Observer

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Spans = dict[tuple[int, float], tuple[float, float]]

STEPS = (6, 4)  # of Gauss–Newton at the bandwidth in use, to begin with, and from there at each
NEGLIGIBLE = 0.05  # [standard deviations] a step that ends a fit


@dataclass(frozen=True)
class BandwidthData:
    """One bandwidth's data.

    Attributes:
        bandwidth: [rad/s].
        signals: of a single observer, or of the wide one of two.
        equation: of a single observer, or of the narrow one of two.
        two_band: the two; None for a single observer.
        own_error: shape (N, n), what this bandwidth alone adds to the residual [Nm].
    """

    bandwidth: float
    signals: Signals
    equation: Equation
    two_band: TwoBandData | None
    own_error: Array | float = 0.0

    def residual(self, x: Array) -> Array:
        """The residual at x, shape (N, n)."""
        equation = self.equation if self.two_band is None else self.two_band.wide
        equation.prepare(x)
        return equation.residual(x) - self.own_error


@dataclass(frozen=True)
class BandwidthFit:
    """Parameters at one bandwidth.

    Attributes:
        x: shape (P,).
        cov, share: covariance, shape (P, P), and the prior's share of each variance, shape (P,).
        at_bound: shape (P,).
        tolerance: shape (n,), model error allowed for beside the noise [Nm²].
        influence: shape (D, P), what each second of the residual does to x; their sum is nearly zero.
    """

    x: Array
    cov: Array
    share: Array
    at_bound: Bools
    tolerance: Array
    influence: Array


# -- the data of each bandwidth ------------------------------------------------------------------------


def refined_bands(
    measurements: MeasurementSet, groups: list[Group], layout: Layout, factors: list[float]
) -> list[BandwidthData]:
    found: dict[float, BandwidthData] = {}  # in coarse records some factors give the same wide band
    for factor in factors:
        weighing = replace(SEARCH_WEIGHTING, hertz=SEARCH_WEIGHTING.hertz * factor, ridge=0.0)
        two_band = weighing.two_band(measurements, groups, layout)
        signals = two_band.wide.signals
        bandwidth = float(np.max(signals.observer.bandwidth))
        found.setdefault(bandwidth, BandwidthData(bandwidth, signals, two_band.narrow, two_band))
    return list(found.values())


def without_own_error(band: BandwidthData, wider: BandwidthData, x: Array) -> BandwidthData:
    """The band as if its residual had been formed in the wider band and low-passed afterwards.

    Products of narrowly filtered signals are not the filtered products. That is an error of the narrow band;
    it must not be held against the parameters that the wider one gave.
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
        formed = CubicSpline(wider.signals.time[source.rows], slow)(band.signals.time[own.rows])
        error[own.rows] = residual[own.rows] - formed
    return replace(band, own_error=error)


def plain_bands(
    measurements: MeasurementSet,
    groups: list[Group],
    layout: Layout,
    observer: Observer,
    factors: list[float],
) -> list[BandwidthData]:
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
    """Which stretch a block is: its group and when it begins."""
    block = band.signals.blocks[index]
    return block.group, float(block.segment.time[0])


def spans(bands: list[BandwidthData]) -> Spans:
    """First and last instant of every stretch that all bandwidths have [s]."""
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
    """Which second of what every bandwidth has a sample belongs to, shape (N,); −1 outside.

    On other samples at every bandwidth, stretches would be compared, not bandwidths.
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
    """Gauss–Newton on Zᵀ W r = b from where `begin` is.

    Unless it is the last fit, it also finds the model error that has to be allowed for where the noise cannot
    be the reason of the residual. With that the last fits are made, at every bandwidth with the same.
    """
    window = seconds >= 0
    two_band = band.two_band
    assert two_band is not None
    layout, blocks = two_band.layout, two_band.blocks
    x = bounds.clip(begin.x)
    two_band.tolerance = begin.tolerance
    weightings, shared = None, []
    iteration = 0
    while True:
        residual, narrow = evaluated(two_band, x)
        residual = residual - band.own_error
        if weightings is None:
            whiteners = two_band.whiteners(x, narrow.link)
            weightings = two_band.weightings(x, narrow, whiteners)
            shared = two_band.instrument_bias(x, narrow.link, whiteners)
        point = weighted_point(two_band, residual, narrow, weightings, shared)
        r, z = point.r * window[:, None], point.z * window[:, None, None]
        chi = np.sum(r**2, axis=0) / max(np.count_nonzero(point.used & window), 1)
        if not last and (two_band.tolerance.any() or float(chi.mean()) > CONSISTENT):
            if not two_band.tolerance.any():
                two_band.tolerance = TOLERANCE**2 * np.mean(point.narrow.torque[0] ** 2, axis=0)
            two_band.tolerance = two_band.tolerance * np.maximum(chi, 0.5)
            weightings = None
        gradient, prior_hessian = prior.gradient_and_hessian(x)
        flat = z.reshape(-1, layout.size)
        information = flat.T @ flat
        hessian = information + prior_hessian
        step, at_bound = bounded_step(
            gradient + compensated_score(two_band, point, window), hessian, x, bounds
        )
        length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
        if length < NEGLIGIBLE or iteration == STEPS[last]:
            break
        x = feasible_step(prior, bounds, x, step)
        iteration += 1
    if not last:
        return replace(begin, x=x, tolerance=two_band.tolerance)
    if two_band.tolerance.any():
        colour = score_covariance(r, z, [b.rows for b in blocks])
    else:
        colour = two_band.noise_score_covariance(x, z, point.weightings) * max(float(chi.mean()), 1.0)
    cov = _covariance(information, colour, prior_hessian, ~at_bound)
    each = np.einsum("tjp,tj->tp", z, r)
    counted = point.used & window
    for block, mean in zip(blocks, shared_part(two_band, point, counted), strict=True):
        each[block.rows] -= counted[block.rows, None] * mean
    influence = _influence(each, hessian, ~at_bound, seconds)
    return BandwidthFit(x, *cov, at_bound, two_band.tolerance, influence)


def fit_plain(
    band: BandwidthData, prior: Prior, bounds: Bounds, begin: BandwidthFit, seconds: Ints, last: bool
) -> BandwidthFit:
    """Least squares weighted by the residual's own size, from where `begin` is."""
    layout = band.equation.layout
    mask = np.broadcast_to((seconds >= 0)[:, None], band.signals.tau.shape[1:])
    solution = gauss_newton(
        band.equation,
        prior,
        bounds,
        bounds.clip(begin.x),
        mask=mask,
        reweightings=2,
        max_iterations=STEPS[last],
    )
    if not last:
        return replace(begin, x=solution.x)
    z = solution.evaluation.jacobian * solution.weights[:, :, None]
    flat = z.reshape(-1, layout.size)
    rows = [b.rows for b in band.signals.blocks]
    r, free = solution.evaluation.residual * solution.weights, ~solution.at_bound
    information = flat.T @ flat
    prior_hessian = prior.gradient_and_hessian(solution.x)[1]
    cov = _covariance(information, score_covariance(r, z, rows), prior_hessian, free)
    each = np.einsum("tjp,tj->tp", z, r)
    influence = _influence(each, information + prior_hessian, free, seconds)
    return BandwidthFit(solution.x, *cov, solution.at_bound, begin.tolerance, influence)


def _influence(each: Array, hessian: Array, free: Bools, seconds: Ints) -> Array:
    """−H⁻¹ times the sum over each second of the samples' scores, shape (N, P)."""
    score = np.zeros((int(seconds.max()) + 1, len(hessian)))
    used = seconds >= 0
    np.add.at(score, seconds[used], each[used])
    out = np.zeros_like(score)
    scale = 1 / np.sqrt(np.maximum(np.diag(hessian)[free], 1e-300))
    scaled = hessian[np.ix_(free, free)] * scale[:, None] * scale
    out[:, free] = (
        -(np.linalg.pinv(scaled, rcond=1e-14, hermitian=True) @ (score[:, free] * scale).T).T * scale
    )
    return out


def unfitted(layout: Layout, x: Array) -> BandwidthFit:
    """Where the first fit begins."""
    size = layout.size
    return BandwidthFit(
        x,
        np.zeros((size, size)),
        np.ones(size),
        np.zeros(size, bool),
        np.zeros(layout.n),
        np.zeros((0, size)),
    )


def _covariance(information: Array, colour: Array, prior: Array, free: Bools) -> tuple[Array, Array]:
    cov, share = np.zeros_like(information), np.ones(len(information))
    index = np.ix_(free, free)
    cov[index], share[free] = covariance(information[index], colour[index], prior[index])
    return cov, share


# -- comparisons --------------------------------------------------------------------------------------


def compared(band: BandwidthData, x: Array, other: BandwidthData, common: Spans, low: FlatZeroPhase) -> Array:
    """The residual's slow part at the other band's samples, where all bands have some, shape (N', n).

    Each stretch is faded in and out: cut off hard, the quick noise at its ends would leak into what is slow.
    Where it is faded fully in, over all but a cycle of the low-pass, nothing is changed; the size is that of
    an unfaded stretch.
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
        out.append(CubicSpline(time, slow)(at[(at >= first) & (at <= last)]))
    if not out:
        raise InputError("the records are too short for these bandwidths; take higher ones")
    return np.concatenate(out)


def difference(one: BandwidthData, other: BandwidthData) -> Transfer:
    a, b = one.signals.observer, other.signals.observer
    return lambda omega, k: a.transfer(omega, k) - b.transfer(omega, k)


def slow_noise(band: BandwidthData, transfer: Transfer, x: Array, low: FlatZeroPhase) -> Array:
    """Standard deviation that white measurement noise leaves in the slow residual, shape (n,) [Nm]."""
    paths = noise_paths(band.equation.layout, x, band.equation.link_terms(x))
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
