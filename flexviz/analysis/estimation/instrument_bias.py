"""Instrument bias due to noise that instruments and residual share.

E[Zᵀ W r] = 0 holds if the noise of Z is independent of that of r. For a compliance it is not: its column of
the Jacobian, ∂r/∂c_j = Σ_k L_k e_j s_j^(k), contains the measured torque and its derivatives. On a loaded
joint the motion outweighs this noise; a light wrist would come out several times too soft. The expectation
follows from the noise model like the covariance of the residual (`whitening`), and the equation solved is Zᵀ
W r = b with b_j = E[z_jᵀ W r].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation.noise_propagation import NoisePath
from flexviz.analysis.estimation.whitening import Whitener
from flexviz.base.arrays import Array, Indices

SAMPLE_SPACING = 5  # the expectation changes slowly, with the pose
MAX_SAMPLES = 400  # per stretch


@dataclass(frozen=True)
class Lookback:
    """W at some samples of a stretch, as matrices applied to the sample and to its predecessors.

    Attributes:
        at: shape (T,), index of the samples.
        weights: shape (p + 1, T, n, n).
    """

    at: Indices
    weights: Array


def lookback(whitener: Whitener) -> Lookback:
    """W at samples with complete predecessors; none if the stretch is too short."""
    order, count = whitener.order, whitener.count
    at = np.arange(order, count, max(SAMPLE_SPACING, -(-(count - order) // MAX_SAMPLES)))
    predictor, scale = whitener.maps(at)
    return Lookback(at, np.concatenate((scale[None], -scale @ predictor)))


def shared_noise(w: Lookback, instrument: NoisePath, residual: NoisePath, kernel: Array) -> Array:
    """Mean over a stretch of (W z_j)ᵀ W r due to white noise of unit variance in the sensors of joints j.

    Neglects nuisance pulses at reversals (few samples) and stretches shorter than the predictor.

    Args:
        w: W of the stretch.
        instrument: noise path of m sensors into z, each into its own column.
        residual: noise path of at least the same sensors into r.
        kernel: shape (2p + 1, D, E), covariance of the filtered noise in both paths (`shared_kernel`) at lags
            −p … p, p being the order of the predictor.

    Returns:
        shape (m,).
    """
    if not w.at.size:
        return np.zeros(len(instrument.joints))
    back = np.arange(len(w.weights))
    # E[z(t−l) r(t−m)] depends on m − l alone
    lags = back[-1] + back - back[:, None]
    size = len(back) * kernel.shape[1], len(back) * kernel.shape[2]
    toeplitz = kernel[lags].transpose(0, 2, 1, 3).reshape(size)
    same = np.searchsorted(residual.joints, instrument.joints)
    z, r = _weighted(w, instrument.matrices), _weighted(w, residual.matrices[..., same])
    product = np.einsum("ax,ax->x", z, toeplitz @ r)
    return product.reshape(-1, len(instrument.joints)).sum(axis=0) / len(w.at)


def _weighted(w: Lookback, matrices: Array) -> Array:
    """W times the matrices (D, N, n, m) of a path: shape ((p + 1)·D, T·n·m)."""
    depth, count, n, m = matrices.shape
    wide = matrices.transpose(1, 2, 0, 3).reshape(count, n, depth * m)
    passed = w.weights @ wide[w.at - np.arange(len(w.weights))[:, None]]
    each = passed.reshape(*passed.shape[:3], depth, m).transpose(0, 3, 1, 2, 4)
    return each.reshape(len(passed) * depth, -1)
