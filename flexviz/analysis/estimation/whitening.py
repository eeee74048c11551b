"""Whitening of the residual by the propagated measurement noise.

White noise in θ and τ passes the observer (known, stationary) and then the equation (known, but changing with
the pose). The residual's covariance between two instants is therefore known in closed form:

    Cov(r_t, r_u) = Σ_jk A_j(t) ρ_jk(t − u) A_k(u)ᵀ,    A_k = ∂r/∂θ^(k) or ∂r/∂τ^(k),

where ρ_jk(t − u) is the covariance of the j-th and k-th derivative of the filtered noise. Each sample is
predicted from its p predecessors with these covariances and scaled by the remaining standard deviation (a
banded approximation of the inverse Cholesky factor; Vecchia, J. R. Stat. Soc. B 50, 1988).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from flexviz.analysis.estimation.noise_propagation import NoiseDerivatives, NoisePath
from flexviz.base._scipy import sp
from flexviz.base.arrays import Array, Bools, Indices
from flexviz.base.fourier import fast_length, line_counts
from flexviz.model.observers import Observer

CHUNK = 150  # samples whitened at a time: they stay in the processor's cache
TOGETHER = 5e5  # numbers of the covariances that are solved at a time


@dataclass(frozen=True)
class Whitener:
    """Linear map of a stretch of the residual to white samples of unit variance.

    Predictor and scale change slowly, with the pose: they are kept at a few samples and interpolated. All of
    them would take more memory than the residual's Jacobian.

    Attributes:
        at: shape (T,), samples at which they are kept; the first and the last one are among them.
        weights: shape (p, T, n, n), prediction of sample t from sample t−1−k.
        factors: shape (T, n, n), inverse Cholesky factor of the prediction error's covariance [1/Nm].
        known: shape (N, n), samples that count, the others are zero; None: all.
    """

    at: Indices
    weights: Array
    factors: Array
    known: Bools | None = None

    @property
    def order(self) -> int:
        """Number of predecessors p."""
        return len(self.weights)

    @property
    def count(self) -> int:
        """Number of samples N of the stretch."""
        return int(self.at[-1]) + 1 if len(self.at) else 0

    def maps(self, samples: Indices) -> tuple[Array, Array]:
        """Predictor (p, M, n, n) and scale (M, n, n) of some samples, shape (M,)."""
        if len(self.at) == self.count:
            return self.weights[:, samples], self.factors[samples]
        place = np.searchsorted(self.at, samples, side="right") - 1
        place = np.minimum(place, len(self.at) - 2)
        share = ((samples - self.at[place]) / (self.at[place + 1] - self.at[place]))[:, None, None]
        predictor = np.take(self.weights, place, axis=1)
        predictor += share * (np.take(self.weights, place + 1, axis=1) - predictor)
        return predictor, self.factors[place] * (1 - share) + self.factors[place + 1] * share

    def apply(self, y: Array, start: int = 0) -> Array:
        """Whiten y, shape (N, n) or (N, n, P): the same shape.

        `start`: sample of the stretch with which y begins; it counts as zero before.
        """
        flat = y.reshape(*y.shape[:2], -1)
        order, n = self.order, y.shape[1]
        if self.known is not None:
            flat = flat * self.known[start : start + len(flat), :, None]
        out = np.empty(flat.shape)  # C order, whatever that of y: weightings change it in place
        for first, last in _chunks(len(flat)):
            predictor, scale = self.maps(np.arange(start + first, start + last))
            weights = predictor[::-1].transpose(1, 2, 0, 3).reshape(last - first, n, order * n)
            here = np.ascontiguousarray(flat[max(first - order, 0) : last])
            if first < order:
                here = np.concatenate([np.zeros((order - first, *flat.shape[1:])), here])
            # the predecessors of a sample follow one another in memory: one product instead of one for each
            past = as_strided(here, (last - first, order * n, flat.shape[2]), here.strides, writeable=False)
            out[first:last] = scale @ (here[order:] - weights @ past)
        return out.reshape(y.shape)

    def transposed(self, z: Array) -> Array:
        """Wᵀ z for z of shape (N, n, P): the same shape."""
        out = np.zeros_like(z)
        for first, last in _chunks(len(z)):
            predictor, scale = self.maps(np.arange(first, last))
            scaled = scale.transpose(0, 2, 1) @ z[first:last]
            out[first:last] += scaled
            for k, matrix in enumerate(predictor):
                skipped = max(k + 1 - first, 0)
                if first + skipped < last:
                    out[first + skipped - k - 1 : last - k - 1] -= (
                        matrix[skipped:].transpose(0, 2, 1) @ scaled[skipped:]
                    )
        return out if self.known is None else out * self.known[: len(z), :, None]


def _chunks(count: int) -> list[tuple[int, int]]:
    """First and last sample of each chunk in which `count` samples are whitened."""
    return [(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]


def noise_kernel(
    observer: Observer, joint_step: float, raw_step: float, derivatives: NoiseDerivatives, lags: int
) -> Array:
    """Covariance E[x_j(t) x_k(t − lag)] of D derivatives of filtered white noise, shape (lags + 1, D, D).

    Arguments as of `shared_kernel`.
    """
    return shared_kernel((observer,) * 2, joint_step, raw_step, (derivatives,) * 2, lags)[lags:]


@lru_cache(maxsize=256)  # without dampers, they are the same for all models fitted to the same signals
def shared_kernel(
    observers: tuple[Observer, Observer],
    joint_step: float,
    raw_step: float,
    derivatives: tuple[NoiseDerivatives, NoiseDerivatives],
    lags: int,
) -> Array:
    """Covariance of the same white noise, of unit variance per raw sample, after two observers.

    Args:
        observers: x and y pass these.
        joint_step: step of the equation's samples [s].
        raw_step: step of the raw samples [s].
        derivatives: D of x and E of y.
        lags: −lags … lags.

    Returns:
        shape (2·lags + 1, D, E), not to be changed: E[x_j(t) y_k(t − lag)].
    """
    # a spectrum that resolves the band and contains the lags
    slowest = min(float(np.min(observer.bandwidth)) for observer in observers) * joint_step
    length = 2 ** int(np.ceil(np.log2(max(8192, 4 * lags, 500 / slowest))))
    omega = np.linspace(0.0, np.pi / joint_step, length // 2 + 1)
    same = observers[0] is observers[1] and derivatives[0] is derivatives[1]
    one = derivatives[0].gains(observers[0].transfer, omega)
    other = one if same else derivatives[1].gains(observers[1].transfer, omega)
    out = np.empty((2 * lags + 1, len(one), len(other)))
    if lags == 0:  # the mean of the density
        weights = np.full(len(omega), 2.0 * raw_step / joint_step / length)
        weights[[0, -1]] /= 2.0
        out[0] = ((np.array(one) * weights) @ np.conj(other).T).real
        out.flags.writeable = False
        return out
    kept = np.arange(-lags, lags + 1)
    for j, gain in enumerate(one):
        for k, with_it in enumerate(other):
            if same and k < j:  # E[x_j(t) x_k(t − lag)] = E[x_k(t) x_j(t + lag)]
                out[:, j, k] = out[::-1, k, j]
                continue
            density = gain * np.conj(with_it) * (raw_step / joint_step)
            density[-1] = density[-1].real
            out[:, j, k] = np.fft.irfft(density, length)[kept]
    out.flags.writeable = False  # kept
    return out


def lagged_covariance(
    sensitivity: Array, kernel: Array, variance: Array, watch: Callable[[], None] = lambda: None
) -> Array:
    """Cov(r_t, r_{t−k}) for k = 0 … p from one noise source.

    Args:
        sensitivity: shape (D, N, n, m).
        kernel: shape (p + 1, D, D).
        variance: shape (m,), of the raw samples.
        watch: called at every lag; may raise to stop.

    Returns:
        shape (p + 1, N, n, n); entries with t < k are zero.
    """
    depth, count, n, _ = sensitivity.shape
    out = np.zeros((len(kernel), count, n, n))
    # (n, D, m, N): the samples follow one another in memory
    along = np.ascontiguousarray(sensitivity.transpose(2, 0, 3, 1))
    pairs = n, *along.shape  # of the joints of r_t and r_{t−k}
    wide = np.broadcast_to((along * variance[:, None])[:, None], pairs)
    for k, rho in enumerate(kernel[:count]):
        watch()
        earlier = np.broadcast_to((rho @ along.reshape(n, depth, -1)).reshape(along.shape), pairs)
        out[k, k:] = np.einsum("abdmt,abdmt->tab", wide[..., k:], earlier[..., : count - k])
    return out


def paths_covariance(
    paths: Sequence[NoisePath],
    kernels: Sequence[Array],
    noise: tuple[Array, Array],
    rows: slice,
    watch: Callable[[], None] = lambda: None,
) -> Array:
    """Cov(r_t, r_{t−k}) for k = 0 … p from all of the noise, shape (p + 1, N, n, n).

    Args:
        paths: through the equation.
        kernels: of each, shape (p + 1, D, D).
        noise: standard deviations of θ and τ per raw sample, shape (n,) each.
        rows: the N samples.
        watch: as of `lagged_covariance`.
    """
    total: Array | None = None
    for path, kernel in zip(paths, kernels, strict=True):
        part = lagged_covariance(path.matrices[:, rows], kernel, path.variance(noise), watch)
        total = part if total is None else np.add(total, part, out=total)
    assert total is not None
    return total


def noise_score_covariance(
    weights: Array,
    path: NoisePath,
    variance: Array,
    observer: Observer,
    joint_step: float,
    raw_step: float,
) -> Array:
    """Covariance of Σ_t weights_tᵀ r_t for r due to white noise on one path.

    Exact, whereas the whitened residual is not quite white at the low frequencies of the motion: a predictor
    of few samples cannot resolve how little noise there is.

    Args:
        weights: shape (N, n, P).
        path: at the N samples.
        variance: shape (m,), of the raw samples of its m sensors.
        observer: whose transfer functions the noise passes.
        joint_step: step of the equation's samples [s].
        raw_step: step of the raw samples [s].

    Returns:
        shape (P, P).
    """
    length = fast_length(2 * len(weights))
    omega = np.arange(length // 2 + 1, dtype=float) * (2 * np.pi / (length * joint_step))
    share = line_counts(length)
    if length % 2 == 0:
        share[-1] = 0.0  # the Nyquist bin has no sign, so its odd derivatives have no meaning
    scale = np.sqrt(share[:, None] / length * variance * raw_step / joint_step)
    size = weights.shape[2]
    total = np.zeros((len(omega), len(variance), size), complex)
    for matrix, gain in zip(path.matrices, path.derivatives.gains(observer.transfer, omega), strict=True):
        passed = np.fft.rfft(matrix.transpose(0, 2, 1) @ weights, length, axis=0)
        total += np.conj(gain)[:, None, None] * passed
    flat: NDArray[np.complex128] = (total * scale[:, :, None]).reshape(-1, size)
    return flat.real.T @ flat.real + flat.imag.T @ flat.imag


def whitener(
    covariance: Array,
    every: int = 1,
    ridge: float = 0.0,
    known: Bools | None = None,
    watch: Callable[[], None] = lambda: None,
) -> Whitener:
    """Whitener from the covariance of the residual.

    A sample that is not known predicts no other one: it counts as independent.

    Args:
        covariance: Cov(r_t, r_{t−k}), shape (p + 1, N, n, n).
        every: spacing of the samples at which the predictor is computed, interpolated in between, as it
            changes slowly with the pose; 1 is exact.
        ridge: share of the variance added to that of the preceding samples. Without it, the predictor
            amplifies the stop band of the filter, where a sharp reversal leaves more than noise. Unit
            variance stays exact.
        known: shape (N, n), samples that count; then `every` is 1.
        watch: called now and then; may raise to stop.
    """
    if known is not None and known.all():
        known = None
    if known is not None:
        covariance, every = _of_known(covariance, known), 1
    order, count, n = len(covariance) - 1, covariance.shape[1], covariance.shape[2]
    every = min(every, max(1, (count - order - 1) // 2))
    begun = np.arange(min(order, count))  # the first samples have fewer before them
    later = np.unique(np.r_[np.arange(order, count, every), count - 1]) if count > order else np.arange(0)
    at = np.concatenate([begun, later])
    weights = np.empty((len(at), order, n, n))
    scale = np.empty((len(at), n, n))
    chunk = max(1, int(TOGETHER / (order * n) ** 2))
    for start in range(0, len(at), chunk):
        watch()
        part = slice(start, min(start + chunk, len(at)))
        weights[part], scale[part] = _predict(covariance, at[part], ridge)
    return Whitener(at, np.ascontiguousarray(weights.transpose(1, 0, 2, 3)), scale, known)


def _of_known(covariance: Array, known: Bools) -> Array:
    """The covariance in which samples that are not `known`, (N, n), are independent of all others."""
    out = covariance.copy()
    for lag, part in enumerate(out[:, :]):
        part[lag:] *= known[lag:, :, None] & known[: len(known) - lag, None, :]
    sample, joint = np.nonzero(~known)
    out[0, sample, joint, joint] = np.mean(covariance[0].diagonal(axis1=1, axis2=2), axis=0)[joint]
    return out


def _predict(covariance: Array, t: Indices, ridge: float) -> tuple[Array, Array]:
    """Predictor (T, p, n, n) of the samples t, and inverse Cholesky factor (T, n, n) of its error."""
    order, n = len(covariance) - 1, covariance.shape[2]
    past = np.empty((len(t), order, n, order, n))
    for i in range(order):
        row = covariance[: order - i, np.maximum(t - 1 - i, 0)]  # Cov(r_{t−1−i}, r_{t−1−j}) for j = i … p − 1
        missing = t - 1 - np.arange(i, order)[:, None] < 0
        if missing.any():  # before the first sample: independent, of unit variance
            row[missing] = 0.0
            row[0, missing[0]] = np.eye(n)
        past[:, i, :, i:, :] = row.transpose(1, 2, 0, 3)  # the blocks above the diagonal suffice
    flat = past.reshape(len(t), order * n, order * n)
    added = ridge * np.trace(covariance[0].mean(axis=0)) / n
    diagonal = np.arange(order * n)
    flat[:, diagonal, diagonal] += added
    # (T, n, p n): Cov(r_t, r_{t−1−k})
    right = covariance[1:, t].transpose(1, 2, 0, 3).reshape(len(t), n, order * n)
    weights = np.array([_solved(matrix, b) for matrix, b in zip(flat, right, strict=True)])
    # with F w = b: Cov − bᵀ w − wᵀ b + wᵀ (F − ridge) w = Cov − bᵀ w − ridge wᵀ w
    remaining = covariance[0, t] - weights @ (right + added * weights).transpose(0, 2, 1)
    remaining = 0.5 * (remaining + remaining.transpose(0, 2, 1))
    scale = np.linalg.inv(np.linalg.cholesky(remaining))
    return weights.reshape(len(t), n, order, n).transpose(0, 2, 1, 3), scale


def _solved(matrix: Array, b: Array) -> Array:
    """Solution x (n, q) of x F = b for the symmetric F whose upper half is `matrix` (q, q), which is lost."""
    # by Cholesky's method, twice as fast as LU; turned arrays are in LAPACK's order and not copied
    _, x, failed = sp.linalg.lapack.dposv(matrix.T, b.T, lower=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the covariance of the residual is not positive definite")
    return x.T
