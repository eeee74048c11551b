"""The data of the two_band: the equation's signals in two bands, and the noise's way through it."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Chain, Equation, Evaluation, Layout, LinkTerms, Signals, build_signals, pulses
from flexviz.estimation.instrument_bias import lookback, shared_noise
from flexviz.estimation.noise_paths import instrument_paths, noise_paths, time_constants
from flexviz.estimation.noise_weighting import NoiseWeighting
from flexviz.estimation.whitening import (
    Whitener,
    lagged_covariance,
    noise_kernel,
    noise_score_covariance,
    paths_covariance,
    shared_kernel,
    whitener,
)
from flexviz.measurements import Group, MeasurementSet
from flexviz.noise import segments_noise
from flexviz.observers import FlatZeroPhase

Array = NDArray[np.float64]

WIDE_HERTZ = 14.0
NARROW_HERTZ = 6.0
SAMPLES_PER_CYCLE = 3.6  # the flat filter ends at 1.8 w: twice that is the sampling theorem's least rate
EDGE = 0.4  # [s] dropped at both ends, at WIDE_HERTZ
ORDER = {1: 40, 2: 32, 3: 24}  # samples before each that predict it; fewer for robots with more joints
LONG_ORDER = 14
FEW = 60  # samples that tell the size of the noise


class TwoBandData:
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

        wide_signals, narrow_signals = (
            build_signals(
                measurements, groups, observer, sample_step=step, exact_step=True, drop=(edge, edge)
            )
            for observer in (wide, narrow)
        )
        self.robot = measurements.robot
        self.blocks = wide_signals.blocks
        self.noise = segments_noise([b.segment for b in self.blocks])
        self._signals = wide_signals, narrow_signals
        self._shared: dict[object, Any] = {}
        self._set(layout)
        self.order, self.every, self.ridge = ORDER.get(layout.n, LONG_ORDER), 1, 0.0
        self.tolerance = np.zeros(layout.n)  # [Nm²] white model error a sample, beside the measurement noise

    def _set(self, layout: Layout) -> None:
        self.layout = layout
        self.wide, self.narrow = (
            Equation(self.robot, signals, layout, self._shared) for signals in self._signals
        )

    def with_layout(self, layout: Layout) -> TwoBandData:
        """The same data for a model with other effects; the signals are shared."""
        other = copy(self)
        other._set(layout)
        return other

    def whiteners(self, x: Array, link: LinkTerms) -> list[Whitener]:
        """One whitener a block, at the parameters x and the narrow band's rigid-body terms."""
        paths = noise_paths(self.layout, x, link)
        kernels: dict[tuple[float, float], list[Array]] = {}
        out = []
        for block in self.blocks:
            raw = block.segment.step
            key = (raw * block.stride, raw)
            if key not in kernels:
                observer = self.wide.signals.observer
                kernels[key] = [noise_kernel(observer, *key, path, self.order) for path in paths]
            cov = paths_covariance(paths, kernels[key], self.noise, block.rows)
            size = np.trace(cov[0].mean(axis=0)) / self.layout.n
            cov[0] += np.diag(1e-9 * size + self.tolerance)
            out.append(whitener(cov, self.every, self.ridge))
        return out

    def instrument_bias(self, x: Array, link: LinkTerms, whiteners: Sequence[Whitener]) -> list[Array]:
        """Mean of (W z)ᵀ W r a sample from the noise that both contain, shape (P,), one a block."""
        paths = {(w.sensor, j): w for w in noise_paths(self.layout, x, link) for j in w.joints}
        observers = self.narrow.signals.observer, self.wide.signals.observer
        out = [np.zeros(self.layout.size) for _ in self.blocks]
        seen = [lookback(w) for w in whiteners]
        for parameters, into_z in instrument_paths(self.layout, x, link):
            into_r = paths[into_z.sensor, into_z.joints[0]]
            variance = into_z.variance(self.noise)
            kernels: dict[tuple[float, float, int], Array] = {}
            for mean, block, w in zip(out, self.blocks, seen, strict=True):
                raw, rows = block.segment.step, block.rows
                key = (raw * block.stride, raw, len(w.weights) - 1)
                if key not in kernels:
                    kernels[key] = shared_kernel(observers, *key[:2], (into_z, into_r), key[2])
                shared = shared_noise(w, into_z.rows(rows), into_r.rows(rows), kernels[key])
                mean[parameters] += variance * shared
        return out

    def noise_level(self, x: Array, link: LinkTerms) -> Array:
        """Mean variance that the measurement noise leaves in the residual, from a few samples, shape (n,)."""
        few = slice(None, None, max(1, self.wide.signals.count // FEW))
        part = LinkTerms(*(term[few] for term in (link.regressor, link.dq, link.dv, link.mass)))
        raw, stride = self.blocks[0].segment.step, self.blocks[0].stride
        variance = np.zeros(self.layout.n)
        for path in noise_paths(self.layout, x, part):
            key = ("kernel", path.orders, path.lags)
            kernel = self._shared.get(key)
            if kernel is None:
                kernel = noise_kernel(self.wide.signals.observer, raw * stride, raw, path, 0)[0]
                if not any(path.lags):  # the others change with the parameters
                    self._shared[key] = kernel
            variance += np.einsum(
                "dtim,de,etim,m->i", path.matrices, kernel, path.matrices, path.variance(self.noise)
            )
        return variance / len(part.mass) + self.tolerance

    def noise_shape(self, x: Array, link: LinkTerms) -> Array:
        """What the whiteners depend on, dimensionless, shape (2n,): logs of the variances, time constants."""
        band = float(np.max(self.wide.signals.observer.bandwidth))
        level = np.log(self.noise_level(x, link))
        return np.concatenate((level, band * time_constants(self.layout, x)))

    def weightings(self, x: Array, narrow: Evaluation, whiteners: list[Whitener]) -> list[NoiseWeighting]:
        """One weighting a block: the whitener, and what is not known of the effects' reversals at x."""
        out = [NoiseWeighting(w) for w in whiteners]
        chain = Chain(x[self.layout.compliance], x[self.layout.link_viscous], narrow.link)
        for unknown in pulses(self.wide, x, chain):
            out[unknown.block] = out[unknown.block].with_unknown(unknown.columns)
        return out

    def noise_score_covariance(self, x: Array, z: Array, weightings: list[NoiseWeighting]) -> Array:
        """Covariance of Zᵀ W r from the measurement noise and the model error, shape (P, P).

        Args:
            x: shape (P,).
            z: shape (N, n, P), whitened instruments; zero where samples are not used.
            weightings: one a block.
        """
        paths = noise_paths(self.layout, x, self.narrow.link_terms(x))
        total = np.zeros((self.layout.size, self.layout.size))
        for block, weighting in zip(self.blocks, weightings, strict=True):
            rows, raw = block.rows, block.segment.step
            weights = weighting.transposed(z[rows])
            steps = (raw * block.stride, raw)
            for path in paths:
                variance, here = path.variance(self.noise), path.rows(rows)
                total += noise_score_covariance(weights, here, variance, self.wide.signals.observer, *steps)
            scaled = (weights * np.sqrt(self.tolerance)[:, None]).reshape(-1, self.layout.size)
            total += scaled.T @ scaled
            unknown = weighting.unknown_share(z[rows])
            total += unknown @ unknown.T
        return total


def residual_noise(
    signals: Signals, layout: Layout, x: Array, link: LinkTerms, noise: tuple[Array, Array]
) -> Array:
    """Mean variance that white noise (σ_θ, σ_τ) leaves in the residual, shape (n,) [Nm²]."""
    total = np.zeros(layout.n)
    for path in noise_paths(layout, x, link):
        for block in signals.blocks:
            raw = block.segment.step
            kernel = noise_kernel(signals.observer, raw, raw, path, 0)
            cov = lagged_covariance(path.matrices[:, block.rows], kernel, path.variance(noise))
            total += np.einsum("tii->i", cov[0])
    return total / signals.count
