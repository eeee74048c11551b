"""Two-band data: residual from a wide filter, instruments from a narrow one, and their noise.

Where an effect jumps in position, as backlash does, the narrow band hardly distinguishes it from compliance,
and Zᵀ W r = b has a second root without the effect, to which most steps lead. Instruments of such an
effect, and of its joint's compliance and link viscous friction, come from the wide band.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flexviz.analysis.estimation.instrument_bias import lookback, shared_noise
from flexviz.analysis.estimation.noise_model import REFINING, WIDE_HERTZ, WeightingSettings
from flexviz.analysis.estimation.noise_propagation import NoisePath, instrument_paths, noise_paths
from flexviz.analysis.estimation.noise_weighting import NoiseWeighting
from flexviz.analysis.estimation.unknown_input import UnknownInput
from flexviz.analysis.estimation.whitening import (
    Whitener,
    lagged_covariance,
    noise_kernel,
    noise_score_covariance,
    paths_covariance,
    shared_kernel,
    whitener,
)
from flexviz.base.arrays import Array, Bools, Indices
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import (
    Equation,
    FilteredProducts,
    Layout,
    LinkTerms,
    OperatingPoint,
    Pulses,
    Signals,
    build_signals,
    pulses,
    time_constants,
)
from flexviz.model.observers import FlatZeroPhase

NARROW_HERTZ = 6.0
SAMPLES_PER_CYCLE = 3.6  # Nyquist rate: the flat filter ends at 1.8 w
EDGE = 0.4  # [s] dropped at both ends, at WIDE_HERTZ
# variance due to an unknown input relative to the noise: up to 1e6 on robots, little in a stiff, light wrist
LEAST_INPUT, LARGEST_INPUT = 1e3, 1e7
INPUT_RIDGE = 1e-11  # least ridge relative to that variance: what it hides stays well-conditioned
# share of the wide band that the filter for products has to leave as it is; beyond, 1e-6 of it is left
PASSED = 0.97
UNUSED = 1e8  # variance of a joint without a torque, relative to the noise: it has no weight
NOISE_SAMPLES = 60  # samples from which the noise level is computed


@dataclass(frozen=True, eq=False)
class BandEvaluation:
    """The equations of both bands at x.

    Attributes:
        x: shape (P,).
        wide_point, narrow_point: operating points of the effects in each band.
        residual: shape (N, n), of the wide band [Nm].
        torque: shape (N, n), transmission torque of the narrow band [Nm].
        link: rigid-body terms of the narrow band.
        jacobian: shape (N, n, P), the instruments (`TwoBandData.instruments`); None if not asked for.
    """

    x: Array
    wide_point: OperatingPoint
    narrow_point: OperatingPoint
    residual: Array
    torque: Array
    link: LinkTerms
    jacobian: Array | None


class TwoBandData:
    """Signals in two bands and their noise.

    Attributes:
        layout: layout of the model.
        wide, narrow: equation in each band.
        wide_columns: parameters whose instruments come from the wide band.
        blocks: stretches of samples.
        noise: standard deviations of θ [rad] and τ [Nm] per raw sample, shape (n,) each.
        noise_model: noise model of the weighting.
        watch: called now and then while signals, whiteners and covariances are computed; may raise to stop.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        groups: Sequence[Group],
        layout: Layout,
        settings: WeightingSettings = REFINING,
        watch: Callable[[], None] = lambda: None,
    ) -> None:
        self.watch = watch
        raw = max(s.step for g in groups for s in g.segments)
        wide_hertz = min(settings.hertz, 0.45 / (FlatZeroPhase.ratio * raw))
        wide = FlatZeroPhase(2 * np.pi * wide_hertz)
        narrow = FlatZeroPhase(2 * np.pi * min(NARROW_HERTZ, wide_hertz))
        edge = EDGE * WIDE_HERTZ / wide_hertz
        step = 1 / (SAMPLES_PER_CYCLE * wide_hertz)
        made = (
            build_signals(
                measurements,
                groups,
                observer,
                sample_step=step,
                exact_step=True,
                drop=(edge, edge),
                watch=watch,
            )
            for observer in (wide, narrow)
        )
        wide_signals, narrow_signals = (replace(signals, sharp=True) for signals in made)
        self.robot = measurements.robot
        self.blocks = wide_signals.blocks
        self.noise = segments_noise([b.segment for b in self.blocks])
        self.noise_model = settings.noise_model(layout.n)
        self._signals = wide_signals, narrow_signals
        self._shared: dict[object, Any] = {}
        self._products = None
        if settings.products:
            twice = FlatZeroPhase(2 * np.pi * min(2 * wide_hertz, 0.45 / (FlatZeroPhase.ratio * raw)))
            # of slower recordings, the wider filter would cut what the wide one still lets pass
            if twice.bandwidth >= PASSED * wide.cutoff(0):
                self._products = FilteredProducts(measurements, groups, wide_signals, twice, edge / 2)
        self._set(layout)

    def _set(self, layout: Layout) -> None:
        self.layout, self.wide_columns = layout, _wide_columns(layout)
        self.wide, self.narrow = (
            Equation(self.robot, signals, layout, self._shared) for signals in self._signals
        )

    def with_layout(self, layout: Layout) -> TwoBandData:
        """The same data for a model with other effects; the signals are shared."""
        other = copy(self)
        other._set(layout)
        return other

    @property
    def known(self) -> Bools:
        """Samples of the residual whose torque is known, shape (N, n)."""
        return self._signals[0].known

    @property
    def has_products(self) -> bool:
        """Whether products of signals are formed before they are filtered."""
        return self._products is not None

    def with_model_error(self, variance: Array) -> TwoBandData:
        """The same data with white model error of variance (n,) [Nm²] added to the measurement noise."""
        return self._with_noise_model(model_error=variance)

    def with_unknown_input(self, unknown: UnknownInput) -> TwoBandData:
        """The same data with an arbitrary torque."""
        return self._with_noise_model(unknown_input=unknown)

    def _with_noise_model(self, **changes: Any) -> TwoBandData:
        other = copy(self)
        other.noise_model = replace(self.noise_model, **changes)
        return other

    def evaluate(
        self, x: Array, after: BandEvaluation | None = None, jacobian: bool = True
    ) -> BandEvaluation:
        """Both equations at x, shape (P,); `after`: an earlier evaluation of the same fit."""
        wide = self.wide.at(x, None if after is None else after.wide_point, moving=True)
        narrow = self.narrow.at(x, None if after is None else after.narrow_point, moving=True)
        if jacobian:
            found = narrow.evaluate(x, moving=True)
            s, link, slopes = found.torque[0], found.link, self.instruments(found.jacobian, wide, x)
        else:
            s, link, slopes = narrow.motor_side(x)[0][0], narrow.link_terms(x), None
        return BandEvaluation(x, wide, narrow, self.residual(wide, x), s.copy(), link, slopes)

    def instruments(self, jacobian: Array, wide: OperatingPoint | None, x: Array) -> Array:
        """The Jacobian (N, n, P) of the narrow band at x, with the columns from the wide band put in place.

        `wide`: its operating point, needed if `wide_columns` is not empty.
        """
        if (at := self.wide_columns).size:
            assert wide is not None
            jacobian[:, :, at] = wide.evaluate(x, moving=True).jacobian[:, :, at]
        return jacobian

    def residual(self, wide: OperatingPoint, x: Array) -> Array:
        """Residual of the wide band at x (P,), shape (N, n) [Nm]; `wide`: its operating point."""
        return wide.residual(x) if self._products is None else self._products.residual(wide, x)

    def pulses(self, wide: OperatingPoint, x: Array, link: LinkTerms) -> list[Pulses]:
        """Unknown pulses in `residual`; `link`: rigid-body terms."""
        return pulses(wide, x, link, products=self.has_products)

    def whiteners(self, x: Array, link: LinkTerms) -> list[Whitener]:
        """One whitener per block, at the parameters x and the rigid-body terms of the narrow band."""
        model, paths = self.noise_model, noise_paths(self.layout, x, link)
        inputs = [] if model.unknown_input is None else [model.unknown_input.path(self.layout, x, link)]
        out = []
        for block, kernels in zip(self.blocks, self._kernels([*paths, *inputs]), strict=True):
            cov = paths_covariance(paths, kernels[: len(paths)], self.noise, block.rows, self.watch)
            size, ridge = np.trace(cov[0].mean(axis=0)) / self.layout.n, model.ridge
            cov[0] += np.diag(1e-9 * size + model.model_error + UNUSED * size * ~self.layout.fitted)
            if model.unknown_input is not None:
                matrices, variance = inputs[0].matrices[:, block.rows], model.unknown_input.variance
                added = lagged_covariance(matrices, kernels[-1], variance)
                ratio = np.trace(added[0].mean(axis=0)) / self.layout.n / size
                kept = float(np.clip(ratio, LEAST_INPUT, LARGEST_INPUT)) if ratio > 1e-9 else ratio
                cov += added * (kept / max(ratio, 1e-300))
                # the ridge is a share of the noise without the input
                cov[0] += max(ridge, INPUT_RIDGE * kept) * size * np.eye(self.layout.n)
                ridge = 0.0
            out.append(whitener(cov, model.every, ridge, self.known[block.rows], self.watch))
        return out

    def joint_whiteners(self, paths: Sequence[NoisePath]) -> list[list[Whitener]]:
        """One whitener per joint and block, for the residual of this joint alone.

        The weighting of the fit also predicts the noise of one joint from that of others; a torque missing on
        one joint would thus appear on others. The model error is omitted: these residuals are inspected for
        the effects that cause it.
        """
        out: list[list[Whitener]] = []
        for block, kernels in zip(self.blocks, self._kernels(paths), strict=True):
            out.append([])
            for j in range(self.layout.n):
                own = [replace(path, matrices=path.matrices[:, :, j : j + 1]) for path in paths]
                cov = paths_covariance(own, kernels, self.noise, block.rows)
                cov[0] *= 1 + 1e-9
                known = self.known[block.rows, j : j + 1]
                out[-1].append(whitener(cov, self.noise_model.every, known=known))
        return out

    def _kernels(self, paths: Sequence[NoisePath]) -> list[list[Array]]:
        """One kernel per path, for every block."""
        observer, order = self.wide.signals.observer, self.noise_model.order
        steps = [(b.segment.step * b.stride, b.segment.step) for b in self.blocks]
        return [[noise_kernel(observer, *step, path.derivatives, order) for path in paths] for step in steps]

    def instrument_bias(self, x: Array, link: LinkTerms, whiteners: Sequence[Whitener]) -> list[Array]:
        """Mean of (W z)ᵀ W r per sample due to shared noise, shape (P,), one per block."""
        paths = {(w.sensor, j): w for w in noise_paths(self.layout, x, link) for j in w.joints}
        narrow, wide = self.narrow.signals.observer, self.wide.signals.observer
        out = [np.zeros(self.layout.size) for _ in self.blocks]
        seen = [lookback(w) for w in whiteners]
        for parameters, into_z in instrument_paths(self.layout, x, link):
            into_r = paths[into_z.sensor, into_z.joints[0]]
            variance = into_z.variance(self.noise)
            derivatives = into_z.derivatives, into_r.derivatives
            observers = wide if np.isin(parameters, self.wide_columns).all() else narrow, wide
            for mean, block, w in zip(out, self.blocks, seen, strict=True):
                self.watch()
                raw, rows = block.segment.step, block.rows
                kernel = shared_kernel(observers, raw * block.stride, raw, derivatives, len(w.weights) - 1)
                shared = shared_noise(w, into_z.rows(rows), into_r.rows(rows), kernel)
                mean[parameters] += variance * shared
        return out

    def noise_shape(self, x: Array, link: LinkTerms) -> Array:
        """Quantities that determine the whiteners, shape (2n,): logs of variances, scaled time constants."""
        band = float(np.max(self.wide.signals.observer.bandwidth))
        level = residual_noise(self.wide.signals, self.layout, x, link, self.noise, samples=NOISE_SAMPLES)
        level += self.noise_model.model_error
        return np.concatenate((np.log(level), band * time_constants(self.layout, x)))

    def weightings(self, evaluation: BandEvaluation, whiteners: list[Whitener]) -> list[NoiseWeighting]:
        """One weighting per block: the whitener and the nuisance pulses at reversals."""
        x, out = evaluation.x, [NoiseWeighting(w) for w in whiteners]
        for unknown in self.pulses(evaluation.wide_point, x, evaluation.link):
            before = out[unknown.block]
            out[unknown.block] = before.with_unknown(unknown.groups, unknown.rows)
        return out

    def noise_score_covariance(
        self, x: Array, link: LinkTerms, z: Array, weightings: list[NoiseWeighting]
    ) -> Array:
        """Covariance of Zᵀ W r due to measurement noise and model error, shape (P, P).

        Args:
            x: shape (P,).
            link: rigid-body terms of the narrow band at x.
            z: shape (N, n, P), whitened instruments; zero for unused samples.
            weightings: one per block.
        """
        paths = noise_paths(self.layout, x, link)
        deviation = np.sqrt(self.noise_model.model_error)
        total = np.zeros((self.layout.size, self.layout.size))
        for block, weighting in zip(self.blocks, weightings, strict=True):
            rows, raw = block.rows, block.segment.step
            weights = weighting.transposed(z[rows])
            steps = (raw * block.stride, raw)
            for path in paths:
                self.watch()
                variance, here = path.variance(self.noise), path.rows(rows)
                total += noise_score_covariance(weights, here, variance, self.wide.signals.observer, *steps)
            scaled = (weights * deviation[:, None]).reshape(-1, self.layout.size)
            total += scaled.T @ scaled
            unknown = weighting.unknown_share(z[rows])
            total += unknown @ unknown.T
        return total


def _wide_columns(layout: Layout) -> Indices:
    """Parameters whose instruments come from the wide band."""
    columns: set[int] = set()
    for effect, where in layout.effect_slices():
        if EFFECTS[effect.effect].abrupt and effect.joint is not None:
            columns.update(range(where.start, where.stop))
            columns.update(part.start + effect.joint for part in (layout.compliance, layout.link_viscous))
    return np.array(sorted(columns), np.intp)


def residual_noise(
    signals: Signals,
    layout: Layout,
    x: Array,
    link: LinkTerms,
    noise: tuple[Array, Array],
    samples: float = np.inf,
) -> Array:
    """Mean variance of the residual due to white noise (σ_θ, σ_τ), shape (n,) [Nm²].

    Args:
        signals: whose observer the noise passes.
        layout, x: the model and its parameters, shape (P,).
        link: rigid-body terms at all samples.
        noise: standard deviations of θ and τ per raw sample, shape (n,) each.
        samples: from about how many poses it is computed.
    """
    every = max(1, int(signals.count / samples))
    total, count = np.zeros(layout.n), 0
    for block in signals.blocks:
        rows, raw = slice(-(-block.rows.start // every) * every, block.rows.stop, every), block.segment.step
        count += len(range(rows.start, rows.stop, every))
        for whole in noise_paths(layout, x, link.rows(rows)):
            for path, observer in whole.by_bandwidth(signals.observer):
                # lag 0: the step of the equation's samples does not matter
                kernel = noise_kernel(observer, raw, raw, path.derivatives, 0)[0]
                weighted = path.matrices * path.variance(noise)
                total += np.einsum("dtim,dtim->i", weighted, np.tensordot(kernel, path.matrices, axes=1))
    return total / max(count, 1)
