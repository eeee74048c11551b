"""Standard errors for correlated residuals.

The residual is filtered noise (and model error), correlated in time and between joints, so that the textbook
covariance σ²(JᵀJ)⁻¹ is wrong, here by up to a factor of twelve. The sandwich estimate A⁻¹ (Jᵀ T J) A⁻¹ uses
the covariance T of the residual, assumed stationary within a group and estimated from its smoothed cross
spectra.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation.linear_algebra import scaled_inverse
from flexviz.base.arrays import Array, Bools
from flexviz.base.fourier import fast_length, line_counts

SMOOTHED_BANDS = 24  # spectra are averaged over 1/24 of the band


@dataclass(frozen=True, eq=False)
class Covariance:
    """Uncertainty of the parameters.

    Attributes:
        matrix: shape (P, P); zero for parameters at a bound.
        prior_share: shape (P,), share of each variance that stems from the prior, 0 … 1.
    """

    matrix: Array
    prior_share: Array

    @property
    def standard_errors(self) -> Array:
        """Standard error of each parameter, shape (P,)."""
        return np.sqrt(np.maximum(np.diag(self.matrix), 0.0))

    def replaced(self, matrix: Array) -> Covariance:
        """With a larger matrix (P, P), of which the prior's part stays as large as it is."""
        before, now = np.diag(self.matrix), np.diag(matrix)
        ratio = np.divide(before, now, out=np.ones_like(now), where=now > 0)
        return Covariance(matrix, self.prior_share * ratio)


def sandwich(
    information: Array,
    score: Array,
    prior: Array,
    at_bound: Bools | None = None,
    measured: Array | None = None,
) -> Covariance:
    """Sandwich covariance including the uncertainty of the prior.

    Args:
        information: shape (P, P), JᵀJ of the weighted Jacobian.
        score: shape (P, P), covariance Jᵀ T J of the score.
        prior: shape (P, P), Hessian of the prior.
        at_bound: shape (P,), parameters held at a bound; default: none.
        measured: shape (P, P), the part of `prior` that was measured, by static tests; default: none.
    """
    size = len(information)
    free = np.ones(size, bool) if at_bound is None else ~at_bound
    index = np.ix_(free, free)
    inverse = scaled_inverse(information[index] + prior[index])
    from_prior = inverse @ prior[index] @ inverse
    matrix, share = np.zeros((size, size)), np.ones(size)
    from_data = inverse @ score[index] @ inverse
    # far from the noise, rounding of a large score may exceed what the data say: the part of the prior stays
    np.fill_diagonal(from_data, np.maximum(np.diag(from_data), 0.0))
    matrix[index] = from_data + from_prior
    believed = from_prior if measured is None else inverse @ (prior - measured)[index] @ inverse
    share[free] = np.diag(believed) / np.maximum(np.diag(matrix)[free], 1e-300)
    return Covariance(matrix, share)


def spectral_covariance(
    residual: Array,
    jacobian: Array,
    rows: Sequence[slice],
    prior: Array,
    at_bound: Bools | None = None,
    measured: Array | None = None,
) -> Covariance:
    """Sandwich covariance with the score from the residual's own spectra; arguments as in the two it uses."""
    flat = jacobian.reshape(-1, jacobian.shape[2])
    free = slice(None) if at_bound is None or not at_bound.any() else np.flatnonzero(~at_bound)
    score = np.zeros((len(prior), len(prior)))
    index = np.arange(len(prior))[free]
    score[np.ix_(index, index)] = score_covariance(residual, jacobian[:, :, free], rows)
    return sandwich(flat.T @ flat, score, prior, at_bound, measured)


def score_covariance(residual: Array, jacobian: Array, rows: Sequence[slice]) -> Array:
    """Score covariance Jᵀ T J with T from the smoothed cross spectra of the residual.

    Args:
        residual: shape (N, n), weighted.
        jacobian: shape (N, n, P), with the same weights.
        rows: stretches of samples that are contiguous in time.

    Returns:
        shape (P, P).
    """
    size = jacobian.shape[2]
    longest = max(r.stop - r.start for r in rows)
    length = fast_length(2 * longest)
    spectrum = cross_spectrum(residual, rows, length)
    least = 1e-12 * float(np.trace(spectrum, axis1=1, axis2=2).real.max()) + 1e-300
    total = np.zeros((size, size))
    weight = np.sqrt(line_counts(length) / length)
    for r in rows:
        j = np.fft.rfft(jacobian[r], length, axis=0)  # (F, n, P)
        factor = np.linalg.cholesky(spectrum + least * np.eye(spectrum.shape[1]))
        flat = (np.matmul(factor.conj().transpose(0, 2, 1), j) * weight[:, None, None]).reshape(-1, size)
        total += flat.real.T @ flat.real + flat.imag.T @ flat.imag
    return total


def cross_spectrum(residual: Array, rows: Sequence[slice], length: int) -> Array:
    """Smoothed cross spectral density per sample, shape (length // 2 + 1, n, n), complex Hermitian."""
    n = residual.shape[1]
    count = length // 2 + 1
    total = np.zeros((count, n, n), complex)
    samples = 0
    for r in rows:
        part = residual[r]
        window = np.hanning(len(part) + 2)[1:-1, None]
        window /= np.sqrt(np.mean(window**2))
        f = np.fft.rfft(part * window, length, axis=0)
        total += f[:, :, None] * f[:, None, :].conj()
        samples += len(part)
    total /= samples
    half = max(1, count // (2 * SMOOTHED_BANDS))
    kernel = np.hanning(2 * half + 3)[1:-1]
    kernel /= kernel.sum()
    padded = np.concatenate((total[half:0:-1].conj(), total, total[-2 : -half - 2 : -1].conj()))
    out = np.empty_like(total)
    for i in range(n):
        for j in range(n):
            out[:, i, j] = np.convolve(padded[:, i, j], kernel, mode="valid")
    return out
