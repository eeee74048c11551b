"""Spectrum of the residual, its noise floor, and a whiteness test per joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.cross_validation import shortest_run
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.residuals import JointResiduals, joint_residuals
from flexviz.statistics import chi_square_tail

Array = NDArray[np.float64]

PASSED = 1.3  # upper limit relative to the flat band; above, the floor is too steep to divide by
BANDS = 40  # of equal width
LAGS = 25  # of the portmanteau statistic; odd for `chi_square_tail`
HANN_LINES = 1.94  # lines of a Hann-windowed spectrum per independent line


@dataclass(frozen=True)
class Spectrum:
    """Spectrum of one joint's residual over all groups.

    Attributes:
        joint: name.
        frequency: shape (F,), centres of the bands [Hz], within the pass band of the wide filter.
        density: shape (F,), of the residual [Nm²/Hz].
        floor: shape (F,), density due to measurement noise [Nm²/Hz].
        std: shape (F,), standard error of `density` [Nm²/Hz].
        lines: shape (F,), spectral lines in each band.
        above: share of the slow residual's variance above the floor; about 0 for noise.
        above_std: its standard error for noise.
        band: shortest band with half of the excess [Hz].
        noise_floor: rms of the slow residual due to measurement noise [Nm].
        rms: of the slow residual [Nm].
        chi_square: mean square of the whitened residual; 1 for noise.
        whiteness: portmanteau statistic, N times the sum of the first LAGS squared autocorrelations of the
            residual divided by its floor in the frequency domain; χ²-distributed for pure noise.
        p_value: probability of a larger statistic for pure noise.
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


def spectra(context: FitContext, fit: Fit, parts: list[JointResiduals] | None = None) -> tuple[Spectrum, ...]:
    """Spectra of all joints, over all groups of the context."""
    parts = joint_residuals(context, fit) if parts is None else parts
    n = fit.layout.n
    used = max(sum(int(np.count_nonzero(p.used)) for p in parts), 1)
    shown = max(sum(int(np.count_nonzero(p.shown)) for p in parts), 1)
    chi = np.sum([np.sum(p.white**2, axis=0) for p in parts], axis=0) / used
    observer = parts[0].two_band.wide.signals.observer
    edges = np.linspace(0.0, PASSED * float(np.max(observer.bandwidth)) / (2 * np.pi), BANDS + 1)
    density, floor, lines = np.zeros((BANDS, n)), np.zeros((BANDS, n)), np.zeros(BANDS)
    ratios: list[tuple[Array, Array]] = []
    slow_floor, slow_size, scatter = np.zeros(n), np.zeros(n), np.zeros(n)
    for part in parts:
        slow_size += np.sum(part.slow**2, axis=0) / shown
        for block in part.two_band.blocks:
            rows = block.rows
            kept = part.residual[rows][part.used[rows]]
            hertz, power = periodogram(kept, block.segment.step * block.stride)
            noise, slow = part.floor(rows, block.segment.step, hertz)
            share = np.count_nonzero(part.shown[rows]) / shown
            slow_floor += share * np.trapezoid(slow, hertz, axis=0)
            # the variance of a mean square is ∫ S² / T
            scatter += share**2 * np.trapezoid(slow**2, hertz, axis=0) * hertz[1]
            passed = hertz < edges[-1]
            hertz, power, noise = hertz[passed], power[passed], noise[passed]
            band = np.searchsorted(edges, hertz, side="right") - 1
            np.add.at(density, band, power)
            np.add.at(floor, band, noise)
            lines += np.bincount(band, minlength=BANDS)
            ratios.append((hertz, power / np.maximum(noise, 1e-300)))
    count = np.maximum(lines, 1)[:, None]
    density, floor = density / count, floor / count
    statistic, p_value = whiteness(
        np.concatenate([r for _, r in ratios]), np.concatenate([h for h, _ in ratios]), float(edges[-1])
    )
    out = []
    for j, name in enumerate(fit.layout.joints):
        run = shortest_run(density[:, j] - floor[:, j])
        out.append(
            Spectrum(
                joint=name,
                frequency=0.5 * (edges[1:] + edges[:-1]),
                density=density[:, j],
                floor=floor[:, j],
                std=density[:, j] * np.sqrt(HANN_LINES / count[:, 0]),
                lines=lines.astype(int),
                above=float(1 - slow_floor[j] / max(float(slow_size[j]), 1e-300)),
                above_std=float(np.sqrt(scatter[j]) / max(float(slow_floor[j]), 1e-300)),
                band=(float(edges[run.start]), float(edges[run.stop])),
                noise_floor=float(np.sqrt(slow_floor[j])),
                rms=float(np.sqrt(slow_size[j])),
                chi_square=float(chi[j]),
                whiteness=float(statistic[j]),
                p_value=float(p_value[j]),
            )
        )
    return tuple(out)


def periodogram(y: Array, step: float) -> tuple[Array, Array]:
    """One-sided density of y, shape (N, n), at its Fourier frequencies: (F,) [Hz] and (F, n) [·²/Hz].

    The Hann window limits leakage: the floor at low frequencies is decades below that at high ones.
    """
    window = np.hanning(len(y) + 2)[1:-1, None]
    power = np.abs(np.fft.rfft(y * window, axis=0)) ** 2 * (2 * step / float(np.sum(window**2)))
    return np.arange(len(power)) / (len(y) * step), power


def whiteness(ratio: Array, hertz: Array, top: float) -> tuple[Array, Array]:
    """Portmanteau statistic of spectra divided by their floor, and its p-value, shape (n,) each.

    The autocorrelations are those of a series with these spectra, sampled at 2 · top.

    Args:
        ratio: shape (F, n), lines of Hann-windowed spectra of one or more stretches.
        hertz: shape (F,), frequencies of the lines.
        top: highest frequency [Hz].
    """
    waves = np.cos(np.outer(np.pi * np.arange(LAGS + 1) / top, hertz)) @ ratio
    correlation = waves[1:] / np.maximum(waves[0], 1e-300)
    statistic = 2 * len(hertz) / HANN_LINES * np.sum(correlation**2, axis=0)
    return statistic, np.array([chi_square_tail(float(one), LAGS) for one in statistic])
