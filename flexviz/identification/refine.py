"""The refinement stage: removes what filtering and noise do to the plain fit.

Two bands. The residual r comes from a wide filter that is exactly flat where the robot moves, so that
products of filtered signals are right; it is full of noise, but that noise's covariance is known
(`whitening`). The Jacobian comes from a narrow filter, so that its noise is small and its correlation with
the residual's noise
negligible: it serves as instrument Z. Solved is Zᵀ W r = 0 with W the inverse covariance — generalised least
squares without the errors-in-variables bias of one band.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Equation, Layout, build_signals
from flexviz.equation.link import LinkTerms
from flexviz.equation.sensitivity import signal_sensitivity
from flexviz.equation.signals import Signals
from flexviz.identification.prior import Prior
from flexviz.identification.solver import Bounds, bounded_step
from flexviz.identification.uncertainty import colour_matrix, covariance
from flexviz.identification.whitening import (
    Whitener,
    lagged_covariance,
    noise_kernel,
    score_covariance,
    whitener,
)
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase, Observer

Array = NDArray[np.float64]

WIDE_HERTZ = 14.0
NARROW_HERTZ = 6.0
SAMPLES_PER_CYCLE = 3.6  # the flat filter ends at 1.8 w: twice that is the sampling theorem's least rate
EDGE = 0.4  # [s] dropped at both ends, at WIDE_HERTZ
ORDER = {1: 40, 2: 32, 3: 24}  # samples before each that predict it; fewer for robots with more joints
LONG_ORDER = 14
CONSISTENT = 2.0  # χ² per sample up to which the measurement noise alone explains the residual
TOLERANCE = 3e-4  # first guess of a model error, relative to the torque's rms
TRANSIENT = 5.0
NEGLIGIBLE = 0.02  # [standard deviations] a step that ends the iteration


@dataclass(frozen=True)
class Refined:
    """Result of the refinement.

    Attributes:
        x: shape (P,).
        covariance: shape (P, P).
        prior_share: shape (P,), share of the prior in each variance.
        chi_square: mean square of the whitened residual.
        chi_squares: shape (n,), the same for each joint.
        converged: the last step was negligible.
        at_bound: shape (P,).
    """

    x: Array
    covariance: Array
    prior_share: Array
    chi_square: float
    chi_squares: Array
    converged: bool
    at_bound: NDArray[np.bool_]


class Refinement:
    """Signals in two bands, and the noise's way through the equation."""

    def __init__(
        self,
        measurements: MeasurementSet,
        groups: Sequence[Group],
        layout: Layout,
        wide_hertz: float = WIDE_HERTZ,
    ) -> None:
        raw = max(s.step for g in groups for s in g.segments)
        wide_hertz = min(wide_hertz, 0.45 / (FlatZeroPhase.ratio * raw))
        wide = FlatZeroPhase(2 * np.pi * wide_hertz)
        narrow = FlatZeroPhase(2 * np.pi * min(NARROW_HERTZ, wide_hertz))
        edge = EDGE * WIDE_HERTZ / wide_hertz
        step = 1 / (SAMPLES_PER_CYCLE * wide_hertz)

        def equation(observer: Observer) -> Equation:
            signals = build_signals(
                measurements, groups, observer, sample_step=step, exact_step=True, drop=(edge, edge)
            )
            return Equation(measurements.robot, signals, layout)

        self.layout = layout
        self.wide = equation(wide)
        self.narrow = equation(narrow)
        self.blocks = self.wide.signals.blocks
        self.noise = segments_noise([b.segment for b in self.blocks])
        self.tolerance = np.zeros(layout.n)  # [Nm²] white model error a sample, beside the measurement noise

    def whiteners(self, x: Array, link: LinkTerms) -> list[Whitener]:
        """One whitener a block, at the parameters x and the narrow band's rigid-body terms."""
        theta, tau = signal_sensitivity(self.layout, x, link)
        order = ORDER.get(self.layout.n, LONG_ORDER)
        kernels: dict[tuple[float, float], tuple[Array, Array]] = {}
        out = []
        for block in self.blocks:
            raw = block.segment.step
            key = (raw * block.stride, raw)
            if key not in kernels:
                kernel = noise_kernel(self.wide.signals.observer, *key, 5, order)
                kernels[key] = kernel, kernel[:, :3, :3]
            wide, narrow = kernels[key]
            rows = block.rows
            cov = lagged_covariance(theta[:, rows], wide, self.noise[0] ** 2)
            cov += lagged_covariance(tau[:, rows], narrow, self.noise[1] ** 2)
            size = np.trace(cov[0].mean(axis=0)) / self.layout.n
            cov[0] += np.diag(1e-9 * size + self.tolerance)
            out.append(whitener(cov))
        return out

    def score_covariance(self, x: Array, z: Array, whiteners: list[Whitener]) -> Array:
        """Covariance of Zᵀ W r from the measurement noise and the model error, shape (P, P).

        Args:
            x: shape (P,).
            z: shape (N, n, P), whitened instruments; zero where samples are not used.
            whiteners: one a block.
        """
        theta, tau = signal_sensitivity(self.layout, x, self.narrow.link_terms(x))
        total = np.zeros((self.layout.size, self.layout.size))
        for block, white in zip(self.blocks, whiteners, strict=True):
            rows, raw = block.rows, block.segment.step
            weights = white.transposed(z[rows])
            way = (self.wide.signals.observer, raw * block.stride, raw)
            total += score_covariance(weights, theta[:, rows], self.noise[0] ** 2, *way)
            total += score_covariance(weights, tau[:, rows], self.noise[1] ** 2, *way)
            scaled = (weights * np.sqrt(self.tolerance)[:, None]).reshape(-1, self.layout.size)
            total += scaled.T @ scaled
        return total

    def noise_variance(self, x: Array, link: LinkTerms) -> Array:
        """Mean variance of the wide residual from measurement noise alone, shape (n,) [Nm²]."""
        return residual_noise(self.wide.signals, self.layout, x, link, self.noise)


def residual_noise(
    signals: Signals, layout: Layout, x: Array, link: LinkTerms, noise: tuple[Array, Array]
) -> Array:
    """Mean variance that white noise (σ_θ, σ_τ) leaves in the residual, shape (n,) [Nm²]."""
    theta, tau = signal_sensitivity(layout, x, link)
    total = np.zeros(layout.n)
    for block in signals.blocks:
        raw = block.segment.step
        kernel = noise_kernel(signals.observer, raw, raw, 5, 0)
        rows = block.rows
        cov = lagged_covariance(theta[:, rows], kernel, noise[0] ** 2)
        cov += lagged_covariance(tau[:, rows], kernel[:, :3, :3], noise[1] ** 2)
        total += np.einsum("tii->i", cov[0])
    return total / signals.count


def refine(
    refinement: Refinement,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    max_iterations: int = 12,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
) -> Refined:
    """Solve Zᵀ W r = 0 (plus the prior) from the plain fit's x.

    Where the residual is far above the measurement noise the model, not the noise, is what is wrong: a white
    model error is then added to the noise, as large as it takes to explain the residual, so that nothing is
    weighted by a noise that does not matter.
    """
    first = _solve(refinement, prior, bounds, x, max_iterations, report)
    if first.chi_square <= CONSISTENT:
        return first
    torque = refinement.narrow.evaluate(x).torque[0]
    refinement.tolerance = TOLERANCE**2 * np.mean(torque**2, axis=0)
    refined = first
    for _ in range(8):
        refined = _solve(refinement, prior, bounds, x, max_iterations, report)
        x = refined.x
        if np.all(refined.chi_squares < 1.5):
            break
        refinement.tolerance = refinement.tolerance * np.maximum(refined.chi_squares, 0.5)
    return refined


@dataclass(frozen=True)
class _Point:
    """Whitened residual (N, n) and instruments (N, n, P) at one x; unusable samples are zero."""

    r: Array
    z: Array
    used: NDArray[np.bool_]


def _whitened(
    refinement: Refinement, x: Array, whiteners: list[Whitener] | None
) -> tuple[_Point, list[Whitener]]:
    lay, blocks = refinement.layout, refinement.blocks
    for equation in (refinement.wide, refinement.narrow):
        equation.prepare(1 / x[lay.compliance])
    wide, narrow = refinement.wide.evaluate(x), refinement.narrow.evaluate(x)
    if whiteners is None:
        whiteners = refinement.whiteners(x, narrow.link)
    pairs = list(zip(whiteners, blocks, strict=True))
    r = np.concatenate([w.apply(wide.residual[b.rows]) for w, b in pairs])
    z = np.concatenate([w.apply(narrow.jacobian[b.rows]) for w, b in pairs])
    used = np.concatenate([settled(r[b.rows]) for b in blocks])
    r[~used] = 0.0
    z[~used] = 0.0
    return _Point(r, z, used), whiteners


def settled(r: Array) -> NDArray[np.bool_]:
    """Samples of one stretch outside the transients at its ends, shape (N,).

    A record that starts with a jump leaves a longer transient than one that does not. The whitened residual
    shows it: windows of 1/80 of the stretch at either end are dropped up to the last one, within the first
    eighth, that is TRANSIENT times as large as usual.
    """
    window = max(3, len(r) // 80)
    count = len(r) // window
    energy = (r[: count * window] ** 2).reshape(count, -1).mean(axis=1)
    usual = np.median(energy)
    loud = energy > TRANSIENT * usual
    used = np.ones(len(r), bool)
    edge = count // 8
    first, last = np.flatnonzero(loud[:edge]), np.flatnonzero(loud[::-1][:edge])
    if first.size:
        used[: (first[-1] + 1) * window] = False
    if last.size:
        used[(count - last[-1] - 1) * window :] = False
    return used


def _solve(
    refinement: Refinement,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    max_iterations: int,
    report: Callable[[Array, float, float], None],
) -> Refined:
    lay, blocks = refinement.layout, refinement.blocks
    whiteners: list[Whitener] | None = None
    iteration = 0
    while True:
        # the noise's way through the equation is followed anew once the parameters are nearly right
        point, whiteners = _whitened(refinement, x, whiteners if iteration >= 2 else None)
        gradient, prior_hessian = prior.gradient_and_hessian(x)
        flat = point.z.reshape(-1, lay.size)
        information = flat.T @ flat
        hessian = information + prior_hessian
        step, at_bound = bounded_step(gradient + flat.T @ point.r.ravel(), hessian, x, bounds)
        length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
        report(x, 0.5 * float((point.r**2).sum()), length)
        converged = length < NEGLIGIBLE and iteration >= 2
        if converged or iteration == max_iterations:
            break
        x = _feasible_step(prior, bounds, x, step)
        iteration += 1
    chi_squares: Array = np.sum(point.r**2, axis=0) / np.count_nonzero(point.used)
    chi_square = float(np.mean(chi_squares))
    free = ~at_bound
    colour = (
        refinement.score_covariance(x, point.z, whiteners or []) * max(chi_square, 1.0)
        if chi_square < 1.2
        else colour_matrix(point.r, point.z, [b.rows for b in blocks])
    )
    cov, share = np.zeros_like(information), np.ones(lay.size)
    index = np.ix_(free, free)
    cov[index], share[free] = covariance(information[index], colour[index], prior_hessian[index])
    return Refined(x, cov, share, chi_square, chi_squares, converged, at_bound)


def _feasible_step(prior: Prior, bounds: Bounds, x: Array, step: Array) -> Array:
    length = 1.0
    compliance = prior.layout.compliance
    for _ in range(30):
        trial = bounds.clip(x + length * step)
        trial[compliance] = np.clip(trial[compliance], 0.2 * x[compliance], 5 * x[compliance])
        if prior.feasible(trial):
            return trial
        length *= 0.5
    return x
