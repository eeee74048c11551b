"""One model's data, fits and residuals at several bandwidths, on the same samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexviz.diagnosis.residuals import noise_density
from flexviz.equation import Equation, Layout, build_signals
from flexviz.equation.sensitivity import signal_sensitivity
from flexviz.equation.signals import Signals, equation_stride
from flexviz.errors import InputError
from flexviz.identification.prior import Prior
from flexviz.identification.refine import CONSISTENT, TOLERANCE, feasible_step, whitened_point
from flexviz.identification.refinement import WIDE_HERTZ, Refinement
from flexviz.identification.solver import Bounds, bounded_step, gauss_newton
from flexviz.identification.uncertainty import colour_matrix, covariance
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase, Observer

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Spans = dict[tuple[int, float], tuple[float, float]]

STEPS = (6, 3)  # of Gauss–Newton at the bandwidth in use, and from there at each other
NEGLIGIBLE = 0.05  # [standard deviations] a step that ends a fit


@dataclass(frozen=True)
class Band:
    """One bandwidth's data."""

    bandwidth: float
    signals: Signals
    equation: Equation
    refinement: Refinement | None


@dataclass(frozen=True)
class Fitted:
    """Parameters at one bandwidth with their covariance and prior share."""

    x: Array
    cov: Array
    share: Array
    at_bound: Bools
    tolerance: Array


# -- the data of each bandwidth ------------------------------------------------------------------------


def refined_bands(
    measurements: MeasurementSet, groups: list[Group], layout: Layout, factors: list[float]
) -> list[Band]:
    out = []
    for factor in factors:
        refinement = Refinement(measurements, groups, layout, WIDE_HERTZ * factor)
        signals = refinement.wide.signals
        bandwidth = float(np.max(signals.observer.bandwidth))
        if out and bandwidth <= out[-1].bandwidth:
            break  # the records are too coarse for wider ones
        out.append(Band(bandwidth, signals, refinement.narrow, refinement))
    return out


def plain_bands(
    measurements: MeasurementSet,
    groups: list[Group],
    layout: Layout,
    observer: Observer,
    factors: list[float],
) -> list[Band]:
    made = [type(observer)(np.asarray(observer.bandwidth) * f) for f in factors]
    settling = np.array([o.settling() for o in made]).max(axis=0)
    step = min(s.step * equation_stride(s, o, 0.025) for o in made for g in groups for s in g.segments)
    out = []
    for each in made:
        signals = build_signals(
            measurements, groups, each, sample_step=step, exact_step=True, drop=(settling[0], settling[1])
        )
        equation = Equation(measurements.robot, signals, layout)
        out.append(Band(float(np.max(each.bandwidth)), signals, equation, None))
    return out


def loose(bounds: Bounds, layout: Layout) -> Bounds:
    """Viscous friction may be negative: a parameter at a bound would not move."""
    lower = bounds.lower.copy()
    lower[layout.link_viscous] = lower[layout.motor_viscous] = -np.inf
    return Bounds(lower, bounds.upper)


def _key(band: Band, index: int) -> tuple[int, float]:
    """Which stretch a block is: its group and when it begins."""
    block = band.signals.blocks[index]
    return block.group, float(block.segment.time[0])


def spans(bands: list[Band]) -> Spans:
    """First and last instant of every stretch that all bandwidths have [s]."""
    found: dict[tuple[int, float], list[Array]] = {}
    for band in bands:
        for index, block in enumerate(band.signals.blocks):
            found.setdefault(_key(band, index), []).append(band.signals.time[block.rows][[0, -1]])
    return {
        key: (max(float(e[0]) for e in ends), min(float(e[1]) for e in ends))
        for key, ends in found.items()
        if len(ends) == len(bands)
    }


def window(band: Band, spans: Spans) -> Bools:
    """Samples that every bandwidth has, shape (N,): else stretches would be compared, not bandwidths."""
    used = np.zeros(band.signals.count, bool)
    for index, block in enumerate(band.signals.blocks):
        first, last = spans.get(_key(band, index), (np.inf, -np.inf))
        time = band.signals.time[block.rows]
        used[block.rows] = (time >= first - 1e-9) & (time <= last + 1e-9)
    return used


# -- fits ---------------------------------------------------------------------------------------------


def fit_refined(
    band: Band, prior: Prior, bounds: Bounds, x: Array, window: Bools, near: Fitted | None
) -> Fitted:
    """Gauss–Newton on Zᵀ W r = 0; a model error is allowed for where the noise cannot be the reason."""
    refinement = band.refinement
    assert refinement is not None
    layout, blocks = refinement.layout, refinement.blocks
    x = bounds.clip(x) if near is None else near.x
    tolerance = np.zeros(layout.n) if near is None else near.tolerance
    refinement.tolerance = tolerance
    whiteners = metrics = None
    iteration = 0
    while True:
        point = whitened_point(refinement, x, whiteners, metrics)
        r, z = point.r * window[:, None], point.z * window[:, None, None]
        chi = np.sum(r**2, axis=0) / max(np.count_nonzero(point.used & window), 1)
        if near is None and float(chi.mean()) > CONSISTENT and iteration < STEPS[0]:
            if not refinement.tolerance.any():
                refinement.tolerance = TOLERANCE**2 * np.mean(point.narrow.torque[0] ** 2, axis=0)
            refinement.tolerance = refinement.tolerance * np.maximum(chi, 0.5)
            whiteners = metrics = None
        else:
            whiteners, metrics = point.whiteners, point.metrics
        gradient, prior_hessian = prior.gradient_and_hessian(x)
        flat = z.reshape(-1, layout.size)
        information = flat.T @ flat
        hessian = information + prior_hessian
        step, at_bound = bounded_step(gradient + flat.T @ r.ravel(), hessian, x, bounds)
        length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
        if length < NEGLIGIBLE or iteration == STEPS[near is not None]:
            break
        x = feasible_step(prior, bounds, x, step)
        iteration += 1
    if refinement.tolerance.any():
        colour = colour_matrix(r, z, [b.rows for b in blocks])
    else:
        colour = refinement.score_covariance(x, z, point.metrics) * max(float(chi.mean()), 1.0)
    return Fitted(
        x, *_covariance(information, colour, prior_hessian, ~at_bound), at_bound, refinement.tolerance
    )


def fit_plain(
    band: Band, prior: Prior, bounds: Bounds, x: Array, window: Bools, near: Fitted | None
) -> Fitted:
    """Least squares weighted by the residual's own size."""
    size = band.equation.layout.size
    mask = np.broadcast_to(window[:, None], band.signals.tau.shape[1:])
    begin = bounds.clip(x) if near is None else near.x
    solution = gauss_newton(
        band.equation, prior, bounds, begin, mask=mask, reweightings=2, max_iterations=STEPS[near is not None]
    )
    z = (solution.evaluation.jacobian * solution.weights[:, :, None]).reshape(-1, size)
    information = z.T @ z
    prior_hessian = prior.gradient_and_hessian(solution.x)[1]
    colour = colour_matrix(
        solution.evaluation.residual * solution.weights,
        solution.evaluation.jacobian * solution.weights[:, :, None],
        [b.rows for b in band.signals.blocks],
    )
    cov = _covariance(information, colour, prior_hessian, ~solution.at_bound)
    return Fitted(solution.x, *cov, solution.at_bound, np.zeros(band.equation.layout.n))


def _covariance(information: Array, colour: Array, prior: Array, free: Bools) -> tuple[Array, Array]:
    cov, share = np.zeros_like(information), np.ones(len(information))
    index = np.ix_(free, free)
    cov[index], share[free] = covariance(information[index], colour[index], prior[index])
    return cov, share


# -- comparisons --------------------------------------------------------------------------------------


def compared(
    band: Band,
    x: Array,
    other: Band,
    spans: Spans,
    low: FlatZeroPhase,
) -> Array:
    """The residual's slow part at the other band's samples, where all bands have some, shape (N', n)."""
    equation = band.equation if band.refinement is None else band.refinement.wide
    equation.prepare(x)
    residual = equation.evaluate(x).residual
    edge = 2 * np.pi / float(np.max(low.bandwidth))  # of the low-pass itself
    there = {_key(other, k): b for k, b in enumerate(other.signals.blocks)}
    out = []
    for index, own in enumerate(band.signals.blocks):
        key = _key(band, index)
        if key not in spans:
            continue
        time = band.signals.time[own.rows]
        inside = (time >= spans[key][0] - 1e-9) & (time <= spans[key][1] + 1e-9)
        slow = low.derivatives(residual[own.rows][inside], own.segment.step * own.stride, 1)[0]
        at = other.signals.time[there[key].rows]
        at = at[(at >= spans[key][0] + edge) & (at <= spans[key][1] - edge)]
        if len(at):
            out.append(CubicSpline(time[inside], slow)(at))
    if not out:
        raise InputError("the records are too short for these bandwidths; take higher ones")
    return np.concatenate(out)


def difference(one: Band, other: Band) -> Callable[[Array, int], Array]:
    a, b = one.signals.observer, other.signals.observer
    return lambda omega, k: a.transfer(omega, k) - b.transfer(omega, k)


def slow_noise(band: Band, transfer: Callable[[Array, int], Array], x: Array, low: FlatZeroPhase) -> Array:
    """Standard deviation that white measurement noise leaves in the slow residual, shape (n,) [Nm]."""
    sensitivity = signal_sensitivity(band.equation.layout, x, band.equation.link_terms(x))
    noise = segments_noise([b.segment for b in band.signals.blocks])
    hertz = np.linspace(0.0, FlatZeroPhase.ratio * float(np.max(low.bandwidth)) / (2 * np.pi), 200)
    total = 0.0
    for block in band.signals.blocks:
        here = sensitivity[0][:, block.rows], sensitivity[1][:, block.rows]
        density = noise_density(
            here, noise, lambda w, k: transfer(w, k) * low.transfer(w, 0), block.segment.step, hertz
        )
        total += (
            (block.rows.stop - block.rows.start) / band.signals.count * np.trapezoid(density, hertz, axis=0)
        )
    return np.sqrt(total)
