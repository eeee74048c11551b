"""The residual's spectrum against the noise floor, and each joint's own χ² and whiteness.

The noise's way through the equation is known in closed form (`identification.whitening`), so the floor is
computed, not drawn from one more noise replicate: it has no scatter of its own, and it is there at every
frequency for the price of a few small matrix products.

Every joint is judged by its own residual alone. The fit's whitener also predicts one joint's noise from the
others', which is right for estimating, but then a torque that is missing on one joint shows on every joint
that comes after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from flexviz._scipy import fft
from flexviz.diagnosis.crossval import carrying
from flexviz.diagnosis.fitting import Fit, Workbench
from flexviz.equation import Evaluation
from flexviz.equation.residual import Chain
from flexviz.equation.sensitivity import signal_sensitivity
from flexviz.equation.undecided import pulses
from flexviz.identification.metric import Metric
from flexviz.identification.refinement import LONG_ORDER, ORDER, Refinement
from flexviz.identification.whitening import noise_kernel, whitener
from flexviz.observers import FlatZeroPhase, Observer

Array = NDArray[np.float64]

SLOW_HERTZ = 6.0  # the residual is shown, and explained by other variables, up to here
SLOW_EDGE = 1 / SLOW_HERTZ  # [s] at both ends, where the quick noise beyond them is not known
SLOW = FlatZeroPhase(2 * np.pi * SLOW_HERTZ)
PASSED = 1.3  # times the wide filter's flat band: above, the floor falls too steeply to divide by
BANDS = 40  # of equal width
LAGS = 25  # of the portmanteau statistic
HANN_LINES = 1.94  # lines of a Hann-windowed spectrum that count as one independent line


@dataclass(frozen=True)
class Spectrum:
    """One joint's residual by frequency, in the wide band, over all samples of the fit.

    Attributes:
        joint: its name.
        frequency: shape (F,), the bands' centres [Hz], as far as the wide filter passes.
        density: shape (F,), of the residual [Nm²/Hz].
        floor: shape (F,), what the measurement noise leaves there [Nm²/Hz].
        std: shape (F,), standard error of `density` [Nm²/Hz].
        lines: shape (F,), lines of the spectra in each band.
        above: share of the slow residual's variance that is above the floor; about 0 for noise.
        above_std: its standard error for noise.
        band: where most of that excess lies [Hz].
        noise_floor: rms of what the measurement noise leaves in the slow residual [Nm].
        rms: of the slow residual [Nm].
        chi_square: mean square of the joint's whitened residual; 1 for noise.
        whiteness: portmanteau statistic, N times the sum of the LAGS first squared autocorrelations of the
            residual divided by its floor, frequency by frequency; χ²-distributed where noise is all there is.
        p_value: probability of a larger one if it were white.
    """

    joint: str
    frequency: Array
    density: Array
    floor: Array
    std: Array
    lines: NDArray[np.int64]
    above: float
    above_std: float
    band: tuple[float, float]
    noise_floor: float
    rms: float
    chi_square: float
    whiteness: float
    p_value: float


@dataclass(frozen=True)
class JointResiduals:
    """The residual of the fit groups or of the validation groups at a fit.

    Attributes:
        refinement: its signals.
        narrow: the equation in the narrow band: s and the link side.
        residual: shape (N, n) [Nm], in the wide band.
        slow: shape (N, n) [Nm], that, low-passed after it was formed; zero where not shown. A residual formed
            from signals filtered as narrowly would also hold what the filter does to their products.
        shown: shape (N,), samples of `slow` that are not next to an end of the stretch.
        white: shape (N, n), every joint whitened by itself; zero where not used.
        used: shape (N,).
        sensitivity: how noise moves the residual, shapes (5, N, n, n) and (3, N, n, n).
    """

    refinement: Refinement
    narrow: Evaluation
    residual: Array
    slow: Array
    shown: NDArray[np.bool_]
    white: Array
    used: NDArray[np.bool_]
    sensitivity: tuple[Array, Array]

    def floor(self, rows: slice, hertz: Array) -> tuple[Array, Array]:
        """Densities of the noise in `residual` and in `slow` over one block, (F, n) each [Nm²/Hz]."""
        block = next(b for b in self.refinement.blocks if b.rows == rows)
        theta, tau = self.sensitivity
        observer = self.refinement.wide.signals.observer
        wide = noise_density(
            (theta[:, rows], tau[:, rows]), self.refinement.noise, observer, block.segment.step, hertz
        )
        return wide, wide * np.abs(SLOW.transfer(2 * np.pi * hertz, 0))[:, None] ** 2


def joint_residuals(bench: Workbench, fit: Fit) -> list[JointResiduals]:
    """Of the fit groups, and of the validation groups where there are some."""
    out = []
    for source, point in ((bench.refinement, fit.point), (bench.validation, fit.held_out)):
        if source is None or point is None:
            continue
        refinement = source.with_layout(fit.layout)
        refinement.wide.prepare(fit.x)
        residual = refinement.wide.evaluate(fit.x).residual
        sensitivity = signal_sensitivity(fit.layout, fit.x, point.narrow.link)
        metrics = joint_metrics(refinement, fit.x, point.narrow, sensitivity)
        white, slow = np.zeros_like(residual), np.zeros_like(residual)
        shown = np.zeros(len(residual), bool)
        for block, row in zip(refinement.blocks, metrics, strict=True):
            for j, metric in enumerate(row):
                white[block.rows, j] = metric.apply(residual[block.rows, j : j + 1])[:, 0]
            kept = block.rows.start + np.flatnonzero(point.used[block.rows])
            step = block.segment.step * block.stride
            inner = slice(edge := int(np.ceil(SLOW_EDGE / step)), max(len(kept) - edge, 0))
            slow[kept[inner]] = SLOW.derivatives(residual[kept], step, 1)[0, inner]
            shown[kept[inner]] = True
        white[~point.used] = 0.0
        out.append(
            JointResiduals(refinement, point.narrow, residual, slow, shown, white, point.used, sensitivity)
        )
    return out


def joint_metrics(
    refinement: Refinement, x: Array, narrow: Evaluation, sensitivity: tuple[Array, Array]
) -> list[list[Metric]]:
    """For every block one metric a joint, of that joint's residual alone."""
    layout = refinement.layout
    theta, tau = sensitivity
    order = ORDER.get(layout.n, LONG_ORDER)
    kernels: dict[tuple[float, float], Array] = {}
    out: list[list[Metric]] = []
    for block in refinement.blocks:
        raw = block.segment.step
        key = (raw * block.stride, raw)
        if key not in kernels:
            kernels[key] = noise_kernel(refinement.wide.signals.observer, *key, 5, order)
        kernel, rows = kernels[key], block.rows
        cov = _own_covariance(theta[:, rows], kernel, refinement.noise[0] ** 2)
        cov += _own_covariance(tau[:, rows], kernel[:, :3, :3], refinement.noise[1] ** 2)
        cov[0] *= 1 + 1e-9
        cov[0] += refinement.tolerance
        out.append([Metric(whitener(cov[:, :, j, None, None])) for j in range(layout.n)])
    chain = Chain(x[layout.compliance], x[layout.link_viscous], narrow.link)
    for unknown in pulses(refinement.wide, x, chain):
        row = out[unknown.block]
        out[unknown.block] = [m.with_unknown(unknown.columns[:, j : j + 1]) for j, m in enumerate(row)]
    return out


def _own_covariance(sensitivity: Array, kernel: Array, variance: Array) -> Array:
    """Cov(r_jt, r_j,t−k) of every joint with itself from one noise source, shape (p + 1, N, n)."""
    count = sensitivity.shape[1]
    out = np.zeros((len(kernel), *sensitivity.shape[1:3]))
    weighted = sensitivity * variance
    for k, rho in enumerate(kernel[:count]):
        earlier = np.tensordot(rho, sensitivity[:, : count - k], axes=(1, 0))
        out[k, k:] = np.einsum("dtim,dtim->ti", weighted[:, k:], earlier)
    return out


def noise_density(
    sensitivity: tuple[Array, Array], noise: tuple[Array, Array], observer: Observer, step: float, hertz: Array
) -> Array:
    """One-sided spectral density that white measurement noise leaves in the residual.

    The sensitivities change slowly against the noise, so that their mean products weigh each frequency.

    Args:
        sensitivity: shapes (5, N, n, n) and (3, N, n, n).
        noise: standard deviations of θ and τ a raw sample, shape (n,) each.
        observer: whose transfer functions the noise passes.
        step: of the raw samples [s].
        hertz: shape (F,).

    Returns:
        shape (F, n) [Nm²/Hz].
    """
    omega: Array = 2 * np.pi * hertz
    total = np.zeros((len(hertz), sensitivity[0].shape[2]))
    for matrices, sigma in zip(sensitivity, noise, strict=True):
        depth, count = matrices.shape[:2]
        products = np.einsum("jtim,ktim,m->jki", matrices, matrices, sigma**2) / count
        gain = np.array([observer.transfer(omega, k) for k in range(depth)])
        total += np.einsum("jf,kf,jki->fi", gain, gain.conj(), products).real
    return 2 * step * total


def spectra(bench: Workbench, fit: Fit, parts: list[JointResiduals] | None = None) -> tuple[Spectrum, ...]:
    """Every joint's residual against the noise floor, over all groups of the bench."""
    parts = joint_residuals(bench, fit) if parts is None else parts
    n = fit.layout.n
    used = sum(int(np.count_nonzero(p.used)) for p in parts)
    shown = max(sum(int(np.count_nonzero(p.shown)) for p in parts), 1)
    chi = sum(np.sum(p.white**2, axis=0) for p in parts) / used
    observer = parts[0].refinement.wide.signals.observer
    edges = np.linspace(0.0, PASSED * float(np.max(observer.bandwidth)) / (2 * np.pi), BANDS + 1)
    centres = 0.5 * (edges[1:] + edges[:-1])
    density, floor, lines = np.zeros((BANDS, n)), np.zeros((BANDS, n)), np.zeros(BANDS)
    waves = np.zeros((LAGS + 1, n))
    slow_floor, slow_size, scatter = np.zeros(n), np.zeros(n), np.zeros(n)
    for part in parts:
        slow_size += np.sum(part.slow**2, axis=0) / shown
        for block in part.refinement.blocks:
            rows = block.rows
            kept = part.residual[rows][part.used[rows]]
            hertz, power = periodogram(kept, block.segment.step * block.stride)
            here = hertz < edges[-1]
            noise, slow = part.floor(rows, hertz)
            share = np.count_nonzero(part.shown[rows]) / shown
            slow_floor += share * np.trapezoid(slow, hertz, axis=0)
            # the variance of a mean square is ∫ S² / T
            scatter += share**2 * np.trapezoid(slow**2, hertz, axis=0) * hertz[1]
            hertz, power, noise = hertz[here], power[here], noise[here]
            band = np.searchsorted(edges, hertz, side="right") - 1
            np.add.at(density, band, power)
            np.add.at(floor, band, noise)
            lines += np.bincount(band, minlength=BANDS)
            lags = np.pi * np.arange(LAGS + 1) / edges[-1]
            waves += np.cos(np.outer(lags, hertz)) @ (power / np.maximum(noise, 1e-300))
    count = np.maximum(lines, 1)[:, None]
    density, floor = density / count, floor / count
    correlation = waves[1:] / waves[0]
    statistic = 2 * lines.sum() / HANN_LINES * np.sum(correlation**2, axis=0)
    out = []
    for j, name in enumerate(fit.layout.joints):
        run = carrying(density[:, j] - floor[:, j])
        out.append(
            Spectrum(
                name,
                centres,
                density[:, j],
                floor[:, j],
                density[:, j] * np.sqrt(HANN_LINES / count[:, 0]),
                lines.astype(int),
                float(1 - slow_floor[j] / max(float(slow_size[j]), 1e-300)),
                float(np.sqrt(scatter[j]) / max(float(slow_floor[j]), 1e-300)),
                (float(edges[run.start]), float(edges[run.stop])),
                float(np.sqrt(slow_floor[j])),
                float(np.sqrt(slow_size[j])),
                float(chi[j]),
                float(statistic[j]),
                float(gammaincc(LAGS / 2, statistic[j] / 2)),
            )
        )
    return tuple(out)


def periodogram(y: Array, step: float) -> tuple[Array, Array]:
    """One-sided density of y (shape (N, n)) at its Fourier frequencies: (F,) [Hz] and (F, n) [·²/Hz].

    A Hann window keeps the floor at low frequencies, decades below that at high ones, from being buried.
    """
    window = np.hanning(len(y) + 2)[1:-1, None]
    power = np.abs(fft.rfft(y * window, axis=0)) ** 2 * (2 * step / float(np.sum(window**2)))
    return np.arange(len(power)) / (len(y) * step), power
