"""Standard errors that know the residual's colour.

The residual is filtered noise (and model error): its samples are correlated in time and between joints, so
the textbook covariance σ²(JᵀJ)⁻¹ is wrong, here by up to a factor of twelve. The sandwich A⁻¹ (Jᵀ T J) A⁻¹
uses the residual's own covariance T, taken as stationary within a group and estimated from its smoothed cross
spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz._scipy import fft

Array = NDArray[np.float64]

SMOOTHING = 24  # spectral bins are averaged over a 1/24 of the band


def score_covariance(residual: Array, jacobian: Array, rows: Sequence[slice]) -> Array:
    """Jᵀ T J with T from the residual's smoothed cross spectra.

    Args:
        residual: shape (N, n), weighted.
        jacobian: shape (N, n, P), weighted alike.
        rows: the stretches of N that are contiguous in time.

    Returns:
        shape (P, P).
    """
    size = jacobian.shape[2]
    longest = max(r.stop - r.start for r in rows)
    length = fft.next_fast_len(2 * longest, real=True)
    spectrum = cross_spectrum(residual, rows, length)
    total = np.zeros((size, size))
    count = length // 2 + 1
    share = np.full(count, 2.0)  # a real signal's spectrum is counted twice but for its ends
    share[0] = 1.0
    if length % 2 == 0:
        share[-1] = 1.0
    for r in rows:
        j = fft.rfft(jacobian[r], length, axis=0)  # (F, n, P)
        factor = np.linalg.cholesky(spectrum + 1e-12 * np.eye(spectrum.shape[1]) * _mean_power(spectrum))
        left = np.matmul(factor.conj().transpose(0, 2, 1), j) * np.sqrt(share / length)[:, None, None]
        flat = left.reshape(-1, size)
        total += flat.real.T @ flat.real + flat.imag.T @ flat.imag
    return total


def _mean_power(spectrum: Array) -> float:
    return float(np.trace(spectrum, axis1=1, axis2=2).real.max()) + 1e-300


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
        f = fft.rfft(part * window, length, axis=0)
        total += f[:, :, None] * f[:, None, :].conj()
        samples += len(part)
    total /= samples
    half = max(1, count // (2 * SMOOTHING))
    kernel = np.hanning(2 * half + 3)[1:-1]
    kernel /= kernel.sum()
    padded = np.concatenate((total[half:0:-1].conj(), total, total[-2 : -half - 2 : -1].conj()))
    out = np.empty_like(total)
    for i in range(n):
        for j in range(n):
            out[:, i, j] = np.convolve(padded[:, i, j], kernel, mode="valid")
    return out


def covariance(information: Array, colour: Array, prior: Array) -> tuple[Array, Array]:
    """Sandwich covariance with the prior's own uncertainty, and the share of the prior in each variance.

    Args:
        information: shape (P, P), JᵀJ of the weighted Jacobian.
        colour: shape (P, P), Jᵀ T J.
        prior: shape (P, P), Hessian of the prior.

    Returns:
        covariance, shape (P, P), and the prior's share of each diagonal entry, shape (P,), 0 … 1.
    """
    matrix = information + prior
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale, rcond=1e-14, hermitian=True)
    inverse = inverse * scale[:, None] * scale
    from_data = inverse @ colour @ inverse
    from_prior = inverse @ prior @ inverse
    total = from_data + from_prior
    return total, np.diag(from_prior) / np.maximum(np.diag(total), 1e-300)
