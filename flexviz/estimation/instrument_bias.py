"""Instrument bias: the noise that instruments and residual share.

The equations Zᵀ W r = 0 hold on average where the noise of Z is independent of that of r. For a
compliance it is not: its column of the Jacobian, ∂r/∂c_j = Σ_k L_k e_j s_j^(k), holds the measured
torque and its derivatives. On a joint that carries much the motion outweighs their noise; on a light wrist it
does not, and the joint comes out several times too soft. The product's expectation follows from the noise as
the residual's own covariance does (`whitening`): what is solved is Zᵀ W r = b, b_j = E[z_jᵀ W r].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.estimation.noise_propagation import NoisePath
from flexviz.estimation.whitening import Whitener

Array = NDArray[np.float64]

SAMPLE_SPACING = 5  # the expectation changes as slowly as the pose
MAX_SAMPLES = 400  # of a stretch


@dataclass(frozen=True)
class Lookback:
    """W as matrices applied to a sample and the samples before it, at some samples of a stretch.

    Attributes:
        at: shape (T,), the samples.
        weights: (p + 1) times shape (T, n, n).
    """

    at: NDArray[np.intp]
    weights: list[Array]


def lookback(whitener: Whitener) -> Lookback:
    """At samples with all of W's memory before them; none where the stretch is too short."""
    order, count = whitener.predictor.shape[:2]
    at = np.arange(order, count, max(SAMPLE_SPACING, -(-(count - order) // MAX_SAMPLES)))
    scale = whitener.scale[at]
    return Lookback(at, [scale, *(-scale @ matrix[at] for matrix in whitener.predictor)])


def shared_noise(w: Lookback, instrument: NoisePath, residual: NoisePath, kernel: Array) -> Array:
    """Mean over a stretch of (W z_j)ᵀ W r from white noise of unit variance in the sensors of joints j.

    Left out are unknown pulses at reversals (few samples) and stretches no longer than W's memory.

    Args:
        w: W of the stretch.
        instrument: path of the m sensors' noise into z, each into its own column, at the stretch's samples.
        residual: of at least the same sensors into r.
        kernel: shape (2p + 1, D, E), covariance of what the paths' filters make of the noise
            (`shared_kernel`) at lags −p … p, p the order of W's predictor.

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
    """W times a path's matrices (D, N, n, m) at each sample and those before: shape ((p + 1)·D, T·n·m)."""
    passed = np.stack([weight @ matrices[:, w.at - k] for k, weight in enumerate(w.weights)])
    return passed.reshape(passed.shape[0] * passed.shape[1], -1)
